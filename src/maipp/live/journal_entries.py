"""What a journal's record says besides the event, read strictly: the answer, and what an arrival changed."""

from typing import Annotated, Any

from maipp.live.events import Arrived, Budget, Change, Event
from maipp.records import Length, Value, Within
from maipp.records.kinds import Finite

_Way = Annotated[float, Within(0, wide=True)]
_Leg = Annotated[tuple[tuple[Finite, Finite], ...], Length(1, 10_000)]
_Packed = Annotated[str, Length(most=1_000_000)]


def read_answer(key: Value) -> dict[str, Any]:
    """What of an answer a record is made of."""
    known = {"answer": str, "surprise": Finite, "reason": str}
    return {name: key[name].fit(kind) for name, kind in known.items() if name in key}


def read_state(key: Value, packed: bool) -> dict[str, Any]:
    """What an arrival changed, or a budget that sent a robot home.

    Unless `packed`, what its planner announces and remembers is left empty.
    """
    if "late" in key.mapping():
        return {"late": key["late"].fit(_Way) if "late" in key else None}
    numbers = {name: key[name].fit(_Way) for name in ("odometer", "planned")}
    homeward = key["homeward"].fit(bool) if "homeward" in key else False
    kept = {name: key[name].fit(_Packed) if packed and name in key else "" for name in ("message", "memory")}
    return {**numbers, "leg": key["leg"].fit(_Leg), "homeward": homeward, **kept}


def read_anchors(key: Value) -> dict[str, Any]:
    """Where roadmaps begin after a change of the survey."""
    return {"anchors": key["anchors"].fit(tuple[tuple[Finite, Finite], ...])}


def read_change(event: Event, values: Value, packed: bool = False) -> dict[str, Any] | None:
    """The `state` of a record of this event; None where it has none."""
    if isinstance(event, Arrived) or (isinstance(event, Budget) and "state" in values):
        return read_state(values["state"], packed)
    if isinstance(event, Change) and "state" in values:
        return read_anchors(values["state"])
    return None
