"""What a line of a bridge reports of its robot, read strictly: the events of `maipp live`, and where it is."""

from typing import Any

from maipp.errors import InputError
from maipp.fleet.vehicle import Fix, Reached, Reading, Report, Wish
from maipp.live.effects import inside
from maipp.live.events import Arrived, Measurement, read_event, write_event
from maipp.live.units import Units

# What one robot cannot say of itself: the fleet finds it out, or decides it.
_NOT_HERE = ("gone", "heard", "joined")
_KINDS = ("arrived", "measurement", "position", "budget", "withdraw", "keep", "speed", "zone", "threshold")


def read_report(values: dict[str, Any], robot: str, units: Units, now: float, *, gated: bool) -> Report | Fix:
    """The report of a line's object; a plain `Fix` for `position`. Of a time left out it is `now`.

    Raises `InputError` for what is unknown, wrong, or too far off to compute with.
    """
    kind = values.get("event")
    if not isinstance(kind, str) or kind not in (*_KINDS, *_NOT_HERE):
        raise InputError(f"event: {str(kind):.60}; give {', '.join(_KINDS)}")
    if kind in _NOT_HERE:
        raise InputError(f"event: {kind} is for `maipp live`; in a fleet robots learn it from each other")
    told = {"id": "-", "robot": robot, "time": now} | {key: value for key, value in values.items() if value is not None}
    if kind in ("zone", "threshold"):
        if told.pop("robot") != robot:
            raise InputError(f"robot: {values['robot']!r:.60}; give {robot}, or leave it out")
        if kind == "zone" and "polygon" in values:
            told["polygon"] = values["polygon"]
    event = read_event(told | ({"event": "arrived"} if kind == "position" else {}), [robot])
    inside(event, units, (None, None), gated)
    if isinstance(event, Measurement):
        return Reading(event.time, event.position, event.travelled, event.value)
    if isinstance(event, Arrived):
        return (Fix if kind == "position" else Reached)(event.time, event.position, event.travelled)
    written = write_event(event)
    return Wish({key: value for key, value in written.items() if key not in ("id", "robot")})
