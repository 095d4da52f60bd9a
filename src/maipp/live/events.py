"""What robots report: the events of the protocol, read strictly, in the caller's own coordinates and units."""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from maipp.live.request import LONGEST_ID, Id, Position
from maipp.records import Length, Value, Within
from maipp.records.kinds import Each, Finite

# Vertices of a zone: planners hold each leg against every edge.
_MOST_VERTICES = 400


def _printable(text: str) -> str | None:
    return "" if any(c < " " or "\ud800" <= c <= "\udfff" for c in text) else None


_Id = Annotated[Id, f"a text of 1 to {LONGEST_ID} characters that no other event has"]
_Time = Annotated[float, Within(0, wide=True), "a time >= 0 in seconds since the survey's epoch"]
_Travelled = Annotated[float, Within(0, wide=True), "the length >= 0 of the way since the robot's start"]
_Budget = Annotated[float, Within(0, wide=True), "a length >= 0"]
_Report = Annotated[Id, f"the id of a measurement, a text of 1 to {LONGEST_ID} characters"]
_Speed = Annotated[float, Within(above=0.0), "a speed > 0"]
_Name = Annotated[Id, _printable, f"a name of 1 to {LONGEST_ID} characters"]
_Ring = Annotated[tuple[Position, ...], Length(3, _MOST_VERTICES)]
_RING = f"3 to {_MOST_VERTICES} positions [x, y] around the border, or null to remove the zone"
_End = Annotated[Literal["start"] | Position | Each[Position], "start, [x, y], or a list of such"]
_Packed = Annotated[str, Length(most=10_000), "the message's own text"]


@dataclass(frozen=True)
class Measurement:
    """A robot measured a value somewhere."""

    id: _Id
    robot: str
    position: Position
    value: Finite
    time: _Time
    travelled: _Travelled | None = None  # what its odometer said then; None: not told


@dataclass(frozen=True)
class Arrived:
    """A robot is somewhere, having nothing left to travel to, and asks where to go."""

    id: _Id
    robot: str
    position: Position
    time: _Time
    travelled: _Travelled | None = None  # what its odometer says; None: to be worked out from positions


@dataclass(frozen=True)
class Gone:
    """A robot is lost or called back: what it announced counts no more."""

    id: _Id
    robot: str
    time: _Time


@dataclass(frozen=True)
class Budget:
    """A robot's whole budget, start to end, is another one from now on."""

    id: _Id
    robot: str
    budget: _Budget
    time: _Time


@dataclass(frozen=True)
class Heard:
    """A robot that another process plans for told where it is and what it announces."""

    id: _Id
    robot: str
    position: Position
    time: _Time
    packed: _Packed  # of the message in that process's answer


@dataclass(frozen=True)
class Withdraw:
    """A measurement counts no more, whatever it is."""

    id: _Id
    robot: str
    measurement: _Report
    time: _Time


@dataclass(frozen=True)
class Keep:
    """A measurement counts, however surprising it is."""

    id: _Id
    robot: str
    measurement: _Report
    time: _Time


@dataclass(frozen=True)
class Speed:
    """A robot travels at another speed from now on."""

    id: _Id
    robot: str
    speed: _Speed
    time: _Time


@dataclass(frozen=True)
class Joined:
    """A robot that the mission does not have takes part from now on."""

    id: _Id
    robot: _Name  # that no other has
    position: Position
    budget: Annotated[float, Within(above=0.0, wide=True), "a length > 0"]
    speed: _Speed
    time: _Time
    end: _End | None = None  # it ends at any of these places; None: anywhere


@dataclass(frozen=True)
class Zone:
    """From now on no robot may enter this polygon; one of the same name is there no more."""

    id: _Id
    name: _Name
    polygon: _Ring | None  # None: nor is any other
    time: _Time


@dataclass(frozen=True)
class Threshold:
    """From now on places count as high-interest from another value."""

    id: _Id
    threshold: Finite
    time: _Time


OfRobot = Measurement | Arrived | Gone | Budget | Heard | Withdraw | Keep | Speed
Change = Joined | Zone | Threshold  # of the survey as a whole
Event = OfRobot | Change

KINDS: dict[str, type[Event]] = {
    "measurement": Measurement,
    "arrived": Arrived,
    "gone": Gone,
    "budget": Budget,
    "heard": Heard,
    "withdraw": Withdraw,
    "keep": Keep,
    "speed": Speed,
    "joined": Joined,
    "zone": Zone,
    "threshold": Threshold,
}


def read_event(values: dict[str, Any], robots: Sequence[str]) -> Event:
    """The event that a request or a journal's record holds; numbers become floats.

    Raises `InputError` for a key that is missing, unknown or wrong.
    """
    report = Value(values)
    kind = KINDS[report["event"].fit(Literal[tuple(KINDS)])]  # type: ignore[valid-type]
    if kind is Zone:
        if "polygon" not in values:  # left out by mistake it must not remove a zone
            report.at("polygon").wrong(f"missing; give {_RING}")
        ring = report["polygon"].fit(_Ring | None, _RING)
        event = report.record(kind, beside=["event", "polygon"], polygon=ring)
    else:
        known = Literal[tuple(robots)]  # type: ignore[valid-type]
        readers = {} if kind is Joined else {"robot": lambda robot: robot.fit(known)}
        event = report.record(kind, readers, beside=["event"])
    return dataclasses.replace(event, **{key: _settled(value) for key, value in vars(event).items()})


def _settled(value: Any) -> Any:
    """The value with 0.0 for -0.0: both mean the same."""
    if isinstance(value, tuple):
        return tuple(map(_settled, value))
    return value + 0.0 if isinstance(value, float) else value


def write_event(event: Event) -> dict[str, Any]:
    """The event as `read_event` reads it; keys without a value are left out."""
    (name,) = (name for name, kind in KINDS.items() if type(event) is kind)
    values = {"event": name} | dataclasses.asdict(event)
    return {key: _listed(v) for key, v in values.items() if v is not None or key == "polygon"}


def _listed(value: Any) -> Any:
    return [_listed(item) for item in value] if isinstance(value, tuple) else value


def fingerprint(event: Event) -> bytes:
    """Digest of the content: equal for requests that say the same, however they are spelled."""
    return hashlib.sha256(json.dumps(write_event(event), sort_keys=True).encode("ascii")).digest()
