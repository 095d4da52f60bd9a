"""What a survey took home, whichever way it was kept: the one thing that maps, tables and reports are made from."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from maipp.engine.episode import Episode
from maipp.foresight import Foresight
from maipp.geo import Crs, GeoReference
from maipp.typing import Float

# Why a sample does not count: the gate's reasons, a person's, and values that say that there is none, such as -9999.
Out = Literal["surprise", "stuck", "withdrawn", "empty"]

# A robot this near to its home is there, measurement intervals: positions are not exact.
AT_HOME = 0.05

# Of positions, and of the foresight whose law is asked for in place of the belief, or None.
Beliefs = Callable[
    [Float[np.ndarray, "p 2"], Foresight | None], tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]
]


@dataclass(frozen=True)
class TakenSample:
    """One measurement, as it was reported."""

    id: str
    robot: str
    time: float  # of the caller: seconds live, the scenario's unit in a record
    x: float  # the caller's coordinates
    y: float
    value: float  # the caller's unit
    surprise: float | None  # standard deviations from what those before led to expect; None where it is not known
    out: Out | None  # why it does not count; None: it does


@dataclass(frozen=True, eq=False)
class TakenRobot:
    """What became of a robot, domain units."""

    name: str
    budget: float
    reserve: float  # of it, kept back
    travelled: float
    status: str  # in words
    time: float  # of its last report, the scenario's
    position: Float[np.ndarray, "2"]  # where it was then
    samples: int  # that it took, whether they count or not
    away: float | None  # straight way from there to the nearest place where it may end; None: anywhere
    home: bool | None  # whether it is there


@dataclass(frozen=True, eq=False)
class Taken:
    """A survey as its team takes it home. Beliefs are those of all that counts, at the end."""

    source: str  # the file's name
    live: bool  # from the journal of a live survey; else from a record
    title: str
    date: str | None
    planner: str
    episode: Episode  # routes and what counts of the samples; its reference is the caller's
    seconds_per_time: float | None  # seconds in the scenario's unit of time; None where it is not known
    crs: Crs  # of the map
    area: np.ndarray | None  # (v, 2) border of the area, the caller's coordinates; None: the domain but its obstacles
    no_go: tuple[np.ndarray, ...]  # (v, 2) borders of what must not be entered, likewise
    threshold_given: bool  # without a threshold all of the area is of interest
    truth_known: bool  # the record's truth is one
    samples: tuple[TakenSample, ...]  # in the order of time
    robots: tuple[TakenRobot, ...]
    belief: Beliefs  # mean and standard deviation at domain positions, standardised values
    notes: tuple[str, ...]  # what to know before trusting the numbers

    @property
    def frame(self) -> GeoReference:
        """The way to the caller's coordinates and values."""
        return self.episode.geo

    @property
    def kept_out(self) -> list[TakenSample]:
        """The samples that do not count."""
        return [sample for sample in self.samples if sample.out is not None]

    @property
    def metres(self) -> float | None:
        """In a domain unit; None where it is not known."""
        return self.frame.metres_per_unit


def from_home(
    position: Float[np.ndarray, "2"], ends: tuple[tuple[float, float], ...], interval: float
) -> tuple[float | None, bool | None]:
    """How far a robot is from the nearest of its ends, and whether that is home; None where it may end anywhere."""
    if not ends:
        return None, None
    away = float(np.hypot(*(np.array(ends) - position).T).min())
    return away, away <= AT_HOME * interval
