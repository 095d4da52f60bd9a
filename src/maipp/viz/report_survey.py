"""What a survey's report tells: the record, and the facts that give it names, places and units."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maipp.engine.episode import Episode
from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.team.broadcast import Broadcast
from maipp.typing import Float


class Foreseen(NamedTuple):
    """What a foresight expects of the true field at the end of a survey, on the evaluation grid, normalised units."""

    name: str  # of the foresight
    mean: Float[np.ndarray, " q"]
    std: Float[np.ndarray, " q"]


@dataclass(frozen=True, eq=False)
class SurveyReport:
    """A record with what makes it readable: every fact but the record has a default.

    Coordinates, values and lengths are those of the record's reference, unless another is given. Raises `InputError`
    for facts that contradict the record or each other.
    """

    episode: Episode
    title: str = "Survey"
    date: str | None = None  # as shown
    names: tuple[str, ...] = ()  # of the robots; empty: agent 0, agent 1, ...
    reference: GeoReference | None = None  # to the user's coordinates and units; None: the record's
    seconds_per_time: float | None = None  # seconds in the scenario's unit of time
    # Shapes are checked below, not annotated: whoever gives others must be told so in words.
    area: np.ndarray | None = None  # (v, 2) outline of the survey area, user's coordinates
    no_go: tuple[np.ndarray, ...] | None = None  # (v, 2) rings; None: the scenario's obstacles, if no area is given
    prior_x: np.ndarray | None = None  # (p, 2) places of earlier samples, user's coordinates; None: the record's
    prior_y: np.ndarray | None = None  # (p,) and their values, user's unit
    truth_known: bool = True  # the record's truth is one; False for a survey of the real world
    broadcasts: tuple[Broadcast, ...] = ()  # in any order
    warnings: tuple[str, ...] = ()  # what the reader must know before trusting the numbers
    summary: tuple[str, ...] = ()  # sentences that come first
    homes: tuple[str, ...] = ()  # of each robot, whether it came home, in words; empty: not told
    kept_out: tuple[tuple[str, ...], ...] = ()  # rows of the samples that do not count, their heading first
    foreseen: Foreseen | None = None  # the map that a foresight draws of all that was measured; None: none was asked

    def __post_init__(self) -> None:
        agents, truth = len(self.episode.agents), np.shape(self.episode.truth)
        if self.names and len(self.names) != agents:
            raise InputError(f"names: {len(self.names)} for {agents} robots; give one each, or none")
        if self.homes and len(self.homes) != agents:
            raise InputError(f"homes: {len(self.homes)} for {agents} robots; give one each, or none")
        seconds, there = self.seconds_per_time, self.reference
        if seconds is not None and not (np.isfinite(seconds) and seconds > 0):
            raise InputError(f"seconds_per_time: {seconds} is not a number > 0")
        if there is not None and there.domain != self.episode.scenario.extent:
            raise InputError(f"reference: its domain is {there.domain}, the record's {self.episode.scenario.extent}")
        if (self.prior_x is None) != (self.prior_y is None):
            raise InputError("prior_x, prior_y: one is given without the other; give both, or neither")
        if self.prior_x is not None and self.prior_y is not None:
            places, values = np.shape(self.prior_x), np.shape(self.prior_y)
            if len(places) != 2 or places[1] != 2 or values != places[:1]:
                raise InputError(f"prior_x, prior_y: shapes {places} and {values}; give (p, 2) and (p,)")
        if self.foreseen is not None and not np.shape(self.foreseen.mean) == np.shape(self.foreseen.std) == truth:
            shapes = np.shape(self.foreseen.mean), np.shape(self.foreseen.std)
            raise InputError(f"foreseen: shapes {shapes[0]} and {shapes[1]}; give the evaluation grid's, {truth}")
        rings = [("area", self.area)] if self.area is not None else []
        for name, ring in rings + [(f"no_go[{i}]", ring) for i, ring in enumerate(self.no_go or ())]:
            shape = np.shape(ring)
            if len(shape) != 2 or shape[1] != 2 or shape[0] < 3 or not np.isfinite(ring).all():
                raise InputError(f"{name}: shape {shape}; give (v, 2) with v >= 3 corners, all of them finite")
        wrong = [told.agent for told in self.broadcasts if not 0 <= told.agent < agents]
        if wrong:
            raise InputError(f"broadcasts: robot {wrong[0]} of {agents}; count from 0")

    @property
    def robots(self) -> tuple[str, ...]:
        """Name of every robot."""
        return self.names or tuple(f"agent {i}" for i in range(len(self.episode.agents)))

    @property
    def geo(self) -> GeoReference:
        """What leads to the user's coordinates and units."""
        return self.reference or self.episode.geo

    @property
    def x_label(self) -> str:
        """What the x axis of a map shows, with its unit."""
        return self._axis_label("longitude (°)", self.geo.x_name)

    @property
    def y_label(self) -> str:
        """What the y axis of a map shows, with its unit."""
        return self._axis_label("latitude (°)", self.geo.y_name)

    @property
    def threshold(self) -> float:
        """Value from which, or up to which, a place is of high interest, in the user's unit."""
        return float(self.geo.to_user_values(self.episode.scenario.threshold))

    @property
    def outline(self) -> Float[np.ndarray, "v 2"]:
        """Border of the area, or of the domain where none is given, which a projection may bend; user's coordinates."""
        if self.area is not None:
            return np.asarray(self.area, np.float64)
        width, height = self.episode.scenario.extent
        along = np.linspace(0.0, 1.0, 16, endpoint=False)[:, None]
        corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height], [0.0, 0.0]])
        sides = [a + along * (b - a) for a, b in zip(corners[:-1], corners[1:], strict=True)]
        return self.geo.to_user(np.concatenate(sides))

    @property
    def rings(self) -> tuple[np.ndarray, ...]:
        """No-go zones in the user's coordinates."""
        if self.no_go is not None:
            return self.no_go
        zones = self.episode.scenario.obstacles if self.area is None else ()
        return tuple(self.geo.to_user(np.array(zone)) for zone in zones)

    @property
    def prior(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Places (p, 2) and values (p,) of earlier samples, user's coordinates and unit; None where there are none."""
        if self.prior_x is not None and self.prior_y is not None:
            found = np.asarray(self.prior_x, np.float64), np.asarray(self.prior_y, np.float64)
        else:
            samples = self.episode.prior
            found = None if samples is None else (self.geo.to_user(samples.x), self.geo.to_user_values(samples.y))
        return found if found is not None and len(found[1]) else None

    def _axis_label(self, degrees: str, other: str) -> str:
        if self.geo.geographic:
            return degrees
        return other if (self.reference or self.episode.reference) is not None else f"{other} (domain units)"
