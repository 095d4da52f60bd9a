"""What a robot of a fleet needs of the vehicle that it runs on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

Place = tuple[float, float]


@dataclass(frozen=True)
class Fix:
    """Where the vehicle is, in the survey's own coordinates and times."""

    time: float
    position: Place
    travelled: float | None = None  # its odometer; None: it has none


@dataclass(frozen=True)
class Reading(Fix):
    """What its sensor measured there."""

    value: float = 0.0


@dataclass(frozen=True)
class Reached(Fix):
    """It is at the end of its way, and holds."""


@dataclass(frozen=True)
class Wish:
    """Something else that is to be reported of this robot: an event of `maipp.live/1`, without id and robot."""

    event: dict[str, object]


Report = Reading | Reached | Wish


@runtime_checkable
class Vehicle(Protocol):
    """A vehicle under way. It holds where it is until it is told to go. Used from one thread."""

    def where(self) -> Fix:
        """Where it is now."""
        ...

    def go(self, waypoints: Sequence[Place], measure: Sequence[Place], *, home: bool = False) -> None:
        """Go along these waypoints, measure at these places on the way, and hold at the last one.

        `home` says that this is the way home, after which nothing comes. Replaces what it was told before.
        """
        ...

    def hold(self) -> None:
        """Stay."""
        ...

    def poll(self) -> list[Report]:
        """What has happened since the last call, in order; does not wait."""
        ...

    def close(self) -> None:
        """Let go of the vehicle, which holds; does nothing the second time."""
        ...


@runtime_checkable
class Answered(Protocol):
    """A vehicle that wants to know what became of its reports, as a bridge does that sends again what got lost."""

    def answered(self, report: Report, answer: Mapping[str, Any]) -> None:
        """The answer to a report, as in `maipp.live/1`: once it is in the log, or refused (`error`, `problem`).

        Comes before what follows from it: `go` or `hold`.
        """
        ...
