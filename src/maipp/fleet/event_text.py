"""What happens in a survey in plain words, for people who watch it."""

from typing import Any

from maipp.live.events import Arrived, Budget, Event, Gone, Joined, Keep, Speed, Threshold, Withdraw, Zone
from maipp.live.units import Units

# Why a robot stops, and why a measurement does not count.
STOPS = {
    "budget": "its budget is spent",
    "home": "it is home",
    "planner": "nothing is left to do",
    "no-go": "no way leads around the no-go zones",
    "gone": "it was reported as gone",
}
OUT = {
    "surprise": "too far from what was expected there",
    "stuck": "the sensor seems to be stuck",
    "withdrawn": "withdrawn by a person",
}


def in_words(event: Event, answer: dict[str, Any], units: Units) -> tuple[str, str] | None:
    """The kind (decision or change) and what happened; None for what is no news by itself, as a measurement is."""
    length, value = units.names["length"], units.names["value"] or ""
    if isinstance(event, Arrived):
        return "decision", _decided(answer)
    if isinstance(event, Gone):
        return "change", "is lost or was called back"
    if isinstance(event, Budget):
        home = "; goes home" if answer.get("answer") == "home" else ""
        return "change", f"has a budget of {event.budget:g} {length} now{home}"
    if isinstance(event, Speed):
        return "change", f"travels at {event.speed:g} {length} per second now"
    if isinstance(event, Joined):
        return "change", f"takes part from now on, with a budget of {event.budget:g} {length}"
    if isinstance(event, Zone):
        return "change", f"no-go zone {event.name} " + ("is no more" if event.polygon is None else "was added")
    if isinstance(event, Threshold):
        return "change", f"values from {event.threshold:g} {value}".rstrip() + " on are of interest now"
    if isinstance(event, Withdraw):
        return "change", "a measurement was withdrawn by a person"
    if isinstance(event, Keep):
        return "change", "a measurement was kept by a person"
    return None


def _decided(answer: dict[str, Any]) -> str:
    late = " (reported late)" if answer.get("late") else ""
    kind = answer.get("answer")
    if kind == "stop":
        reason = answer.get("reason", "")
        return f"stops: {STOPS.get(reason, reason)}{late}"
    number = len(answer.get("measure", []))
    takes = f", {number or 'no'} measurement{'s' * (number > 1)} on the way"
    return ("goes home" if kind == "home" else "sets off for its next place") + takes + late
