"""What robots report: the events of the protocol, read strictly, in the caller's own coordinates and units."""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from maipp.live.request import Fields

_TIME = "a time >= 0 in seconds since the survey's epoch"
_TRAVELLED = "the length >= 0 of the way since the robot's start"


@dataclass(frozen=True)
class Measurement:
    """A robot measured a value somewhere."""

    id: str
    robot: str
    position: tuple[float, float]
    value: float
    time: float
    travelled: float | None = None  # what its odometer said then; None: not told


@dataclass(frozen=True)
class Arrived:
    """A robot is somewhere, having nothing left to travel to, and asks where to go."""

    id: str
    robot: str
    position: tuple[float, float]
    time: float
    travelled: float | None = None  # what its odometer says; None: to be worked out from positions


@dataclass(frozen=True)
class Gone:
    """A robot is lost or called back: what it announced counts no more."""

    id: str
    robot: str
    time: float


@dataclass(frozen=True)
class Budget:
    """A robot's whole budget, start to end, is another one from now on."""

    id: str
    robot: str
    budget: float
    time: float


@dataclass(frozen=True)
class Heard:
    """A robot that another process plans for told where it is and what it announces."""

    id: str
    robot: str
    position: tuple[float, float]
    time: float
    packed: str  # of the message in that process's answer


Event = Measurement | Arrived | Gone | Budget | Heard

KINDS: dict[str, type[Event]] = {
    "measurement": Measurement,
    "arrived": Arrived,
    "gone": Gone,
    "budget": Budget,
    "heard": Heard,
}


def read_event(values: dict[str, Any], robots: Sequence[str]) -> Event:
    """The event that a request or a journal's record holds; numbers become floats.

    Raises `InputError` for a key that is missing, unknown or wrong.
    """
    fields = Fields(values, "event")
    kind = KINDS[fields.one_of("event", KINDS, "event")]
    readers = {
        "id": lambda: fields.text("id", "a text of 1 to 200 characters that no other event has"),
        "robot": lambda: fields.one_of("robot", robots, "robot"),
        "position": lambda: fields.point("position"),
        "value": lambda: fields.number("value", "a finite number"),
        "time": lambda: fields.number("time", _TIME, 0.0),
        "travelled": lambda: fields.optional_number("travelled", _TRAVELLED, 0.0),
        "budget": lambda: fields.number("budget", "a length >= 0", 0.0),
        "packed": lambda: fields.text("packed", "the message's own text", 10_000, empty=True),
    }
    given = {field.name: readers[field.name]() for field in dataclasses.fields(kind)}
    fields.done()
    return kind(**given)


def write_event(event: Event) -> dict[str, Any]:
    """The event as `read_event` reads it; keys without a value are left out."""
    (name,) = (name for name, kind in KINDS.items() if type(event) is kind)
    values = {"event": name} | dataclasses.asdict(event)
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items() if v is not None}


def fingerprint(event: Event) -> bytes:
    """Digest of the content: equal for requests that say the same, however they are spelled."""
    return hashlib.sha256(json.dumps(write_event(event), sort_keys=True).encode("ascii")).digest()
