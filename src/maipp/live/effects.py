"""What an event means in the survey's own units, and what it changes of a robot: the same live and from the journal."""

from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.errors import InputError
from maipp.fields.raster_data import is_stray
from maipp.live.events import (
    Arrived,
    Budget,
    Event,
    Gone,
    Heard,
    Joined,
    Keep,
    Measurement,
    OfRobot,
    Speed,
    Threshold,
    Withdraw,
    Zone,
)
from maipp.live.measurements import Override
from maipp.live.messages import unpack
from maipp.live.robot_state import GONE, RobotState
from maipp.live.scaled_measurement import ScaledMeasurement
from maipp.live.units import Units

Pair = tuple[Any, Any]  # a message and a memory, as the planner has them

# No number in a message is larger; float32 has room for what is computed with it.
_LARGEST_TOLD = 1e9


class Effect(NamedTuple):
    """What an answered event changes."""

    robot: RobotState  # that takes the place of the one of its name
    sample: ScaledMeasurement | None = None
    decision: Override | None = None


def inside(event: Event, units: Units, nothing: Pair, gated: bool = False) -> dict[str, Any]:
    """The event's numbers in domain units, standardised values and the scenario's time.

    `nothing` are the planner's empty message and memory; `gated` says that values of any size may come. Raises
    `InputError` for what cannot be.
    """
    inner: dict[str, Any] = {"time": units.time("time", event.time)}
    if isinstance(event, Measurement | Arrived | Heard | Joined):
        inner["position"] = np.array(units.position("position", event.position))
    if isinstance(event, Measurement | Arrived):
        told = event.travelled
        inner["travelled"] = None if told is None else units.length("travelled", told)
    if isinstance(event, Measurement):
        inner["value"], inner["stray"] = units.value("value", event.value, gated=gated), is_stray(event.value)
    if isinstance(event, Budget | Joined):
        inner["budget"] = units.length("budget", event.budget)
    if isinstance(event, Speed | Joined):
        inner["speed"] = units.speed("speed", event.speed)
    if isinstance(event, Joined):
        inner["ends"] = _ends(event, inner["position"], units)
    if isinstance(event, Zone):
        inner["ring"] = None if event.polygon is None else units.polygon("polygon", event.polygon)
    if isinstance(event, Threshold):
        inner["threshold"] = units.threshold("threshold", event.threshold)
    if isinstance(event, Heard):
        inner["message"] = unpack(event.packed, nothing[0])
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(inner["message"])]
        if any((np.isfinite(leaf) & (abs(leaf) > _LARGEST_TOLD)).any() for leaf in leaves):
            raise InputError(f"packed: holds a number beyond {_LARGEST_TOLD:g}; send what the other process answered")
    return inner


def _ends(event: Joined, position: np.ndarray, units: Units) -> tuple[tuple[float, float], ...]:
    """Where a robot that joins may end, domain units; none: anywhere."""
    if event.end is None:
        return ()
    if event.end == "start":
        x, y = position.tolist()
        return ((x, y),)
    places: Any = event.end if isinstance(event.end[0], tuple) else (event.end,)
    return tuple(units.position("end", place) for place in places)


def taken_late(
    event: Event, inner: dict[str, Any], state: dict[str, Any] | None, robot: RobotState
) -> dict[str, Any] | None:
    """The `state` of a record that is taken over after other records, in whatever order they come.

    What a robot was told before its latest report stands no more: of such an arrival only the way travelled is of use.
    """
    if state is None or inner["time"] >= robot.latest or (robot.answer is None and robot.status != GONE):
        return state
    if isinstance(event, Arrived):
        return {"late": inner["travelled"]}
    return None if isinstance(event, Budget) else state


def effect(
    event: OfRobot,
    inner: dict[str, Any],
    robot: tuple[int, RobotState],
    answer: dict[str, Any],
    state: dict[str, Any] | None,
    nothing: Pair,
) -> Effect:
    """What an answered event changes; `robot` is the one that it is of, and its number.

    `answer` is what was answered, `state` what an arrival changes, or a budget that sends the robot home.
    """
    number, changed = robot[0], robot[1].copy()
    time, sample, decision = inner["time"], None, None
    if isinstance(event, Measurement):
        x, y = inner["position"].tolist()
        sample = ScaledMeasurement(time, number, x, y, inner["value"], inner["stray"])
        changed.note_measurement(time, inner["travelled"])
    elif isinstance(event, Arrived):
        assert state is not None
        if "late" in state:
            changed.note_late(time, state["late"])
        else:
            leg = np.array(state["leg"], np.float64)
            message, memory = unpack(state["message"], nothing[0]), unpack(state["memory"], nothing[1])
            way = time, state["odometer"], state["planned"], leg, answer, message
            changed.arrive(*way, memory, state.get("homeward", False))
    elif isinstance(event, Gone):
        changed.leave(time, nothing[0])
    elif isinstance(event, Budget):
        changed.grant(inner["budget"], time, event.id)
        if state is not None:
            leg = np.array(state["leg"], np.float64)
            changed.divert(time, state["odometer"], state["planned"], leg, answer, nothing[0])
    elif isinstance(event, Speed):
        changed.pace(inner["speed"], time, event.id)
    elif isinstance(event, Heard):
        changed.announce(time, inner["position"], inner["message"])
    elif isinstance(event, Withdraw | Keep):
        decision = Override(time, event.id, isinstance(event, Keep))
    return Effect(changed, sample, decision)
