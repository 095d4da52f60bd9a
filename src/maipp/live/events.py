"""What robots report: the events of the protocol, read strictly, in the caller's own coordinates and units."""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from maipp.live.request import LONGEST_ID, Id, Position
from maipp.records import Length, Value, Within
from maipp.records.kinds import Finite

_Id = Annotated[Id, f"a text of 1 to {LONGEST_ID} characters that no other event has"]
_Time = Annotated[float, Within(0, wide=True), "a time >= 0 in seconds since the survey's epoch"]
_Travelled = Annotated[float, Within(0, wide=True), "the length >= 0 of the way since the robot's start"]
_Budget = Annotated[float, Within(0, wide=True), "a length >= 0"]
_Report = Annotated[Id, f"the id of a measurement, a text of 1 to {LONGEST_ID} characters"]
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


Event = Measurement | Arrived | Gone | Budget | Heard | Withdraw | Keep

KINDS: dict[str, type[Event]] = {
    "measurement": Measurement,
    "arrived": Arrived,
    "gone": Gone,
    "budget": Budget,
    "heard": Heard,
    "withdraw": Withdraw,
    "keep": Keep,
}


def read_event(values: dict[str, Any], robots: Sequence[str]) -> Event:
    """The event that a request or a journal's record holds; numbers become floats.

    Raises `InputError` for a key that is missing, unknown or wrong.
    """
    report = Value(values)
    kind = KINDS[report["event"].fit(Literal[tuple(KINDS)])]  # type: ignore[valid-type]
    known = Literal[tuple(robots)]  # type: ignore[valid-type]
    event = report.record(kind, {"robot": lambda robot: robot.fit(known)}, beside=["event"])
    numbers = {key: value for key, value in vars(event).items() if isinstance(value, float | tuple)}
    # -0.0 becomes 0.0: both mean the same
    zero = {key: tuple(x + 0.0 for x in n) if isinstance(n, tuple) else n + 0.0 for key, n in numbers.items()}
    return dataclasses.replace(event, **zero)


def write_event(event: Event) -> dict[str, Any]:
    """The event as `read_event` reads it; keys without a value are left out."""
    (name,) = (name for name, kind in KINDS.items() if type(event) is kind)
    values = {"event": name} | dataclasses.asdict(event)
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items() if v is not None}


def fingerprint(event: Event) -> bytes:
    """Digest of the content: equal for requests that say the same, however they are spelled."""
    return hashlib.sha256(json.dumps(write_event(event), sort_keys=True).encode("ascii")).digest()
