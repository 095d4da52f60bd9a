"""Answers to questions, which change nothing: who is there, how things stand, what is believed."""

import math
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from maipp.belief.refit import Hyperparameters
from maipp.foresight import Foresight, ForesightName, make_foresight
from maipp.live.belief_query import believe
from maipp.live.changes import Changes
from maipp.live.measurements import MeasurementSet
from maipp.live.messages import describe
from maipp.live.request import PROTOCOL
from maipp.live.robot_state import TRAVELLING, RobotState
from maipp.live.units import Units
from maipp.live.world import Setup, World
from maipp.scenario import Scenario


def hello(world: World, setup: Setup, robots: Sequence[RobotState], events: int, changes: Changes) -> dict[str, Any]:
    """Protocol, planner, units, and the robots, the threshold and the zones as they are now."""
    units = setup.units
    starts = units.points_out(np.asarray(world.mission.start))
    return {
        "answer": "hello",
        "protocol": PROTOCOL,
        "maipp": maipp_version(),
        "planner": setup.planner,
        "units": units.names,
        "epoch": units.epoch,
        "measurement_interval": units.length_out(world.scenario.measurement_interval),
        "robots": [
            {
                "name": robot.name,
                "start": start,
                "budget": units.length_out(robot.budget),
                "speed": units.speed_out(robot.speed),
            }
            for robot, start in zip(robots, starts, strict=True)
        ],
        **_changed(setup, changes),
        "events": events,
    }


def _changed(setup: Setup, changes: Changes) -> dict[str, Any]:
    """The threshold, and the zones that the mission does not have."""
    told = setup.threshold if changes.threshold is None else changes.threshold.told
    rows = [(name, ruling.told) for name, ruling in changes.zones if ruling.told is not None]
    zones = [{"name": name, "polygon": [list(point) for point in ring]} for name, ring in rows]
    return {"threshold": told} | ({"zones": zones} if zones else {})


def state(
    setup: Setup, robots: Sequence[RobotState], events: int, measurements: MeasurementSet, changes: Changes
) -> dict[str, Any]:
    """What is known of the robots, what was changed, and how much has been reported."""
    units = setup.units
    rows = [
        {
            "name": robot.name,
            "status": robot.status,
            "time": units.time_out(robot.time),
            "position": units.points_out(robot.leg[:1])[0],
            "travelled": units.length_out(robot.odometer),
            "budget": units.length_out(robot.budget),
            "speed": units.speed_out(robot.speed),
            "waypoints": units.points_out(robot.leg[1:]) if robot.status == TRAVELLING else [],
            "message": describe(robot.message, units),
        }
        for robot in robots
    ]
    out = [{"id": report, "reason": reason} for report, _, reason in measurements.everything if reason is not None]
    counts = {"answer": "state", "events": events, "measurements": len(measurements)}
    kernel = measurements.kernel
    found = {} if kernel is None else {"kernel": told(kernel, measurements.old, units)}
    return counts | ({"kept_out": out} if out else {}) | found | _changed(setup, changes) | {"robots": rows}


def told(kernel: Hyperparameters, old: int, units: Units) -> dict[str, Any]:
    """A kernel in the caller's units; `measurements` is how many it was fitted to, 0 for the mission's own.

    `old` samples from before the survey are not counted.
    """
    mean, std, noise = (np.array([value]) for value in (kernel.mean, kernel.std, kernel.noise**0.5))
    long = kernel.length_scale * kernel.aspect**0.5
    answer = {
        "measurements": max(kernel.measurements - old, 0),
        "length_scale": units.length_out(kernel.length_scale),
        "mean": units.values_out(mean)[0],
        "std": units.std_out(std)[0],
        "noise": units.std_out(noise)[0],
    }
    if kernel.aspect == 1:
        return answer
    lengths = [units.length_out(long), units.length_out(long / kernel.aspect)]
    return answer | {"length_scales": lengths, "direction": round(math.degrees(kernel.direction), 1)}


def belief(
    world: World,
    setup: Setup,
    measurements: MeasurementSet,
    points: Sequence[tuple[float, float]] | None,
    foresight: ForesightName | None = None,
) -> dict[str, Any]:
    """Mean and standard deviation at the caller's points, or on the evaluation grid; those that a foresight expects
    of the true field as well, if one is named. `InputError` for a point far off."""
    units = setup.units
    answer: dict[str, Any] = {"answer": "belief", "measurements": len(measurements)}
    if points is None:
        where = np.asarray(world.mission.grid, np.float64)
        answer |= {"points": units.points_out(where), "inside": world.mission.inside.tolist()}
    else:
        where = np.array([units.position(f"points[{i}]", point) for i, point in enumerate(points)])
    mean, std = believe(world.mission, measurements, where)
    answer |= {"mean": units.values_out(mean), "std": units.std_out(std)}
    if foresight is None:
        return answer
    mean, std = believe(world.mission, measurements, where, _foresight(foresight, world.scenario))
    return answer | {"foreseen_mean": units.values_out(mean), "foreseen_std": units.std_out(std)}


@lru_cache(maxsize=4)
def _foresight(name: str, scenario: Scenario) -> Foresight:
    """Of a world; made once."""
    return make_foresight(name, scenario)


def header(world: World, setup: Setup) -> dict[str, Any]:
    """What the first line of a journal says of its survey; `world` is the one that nothing was changed of."""
    return {
        "journal": PROTOCOL,
        "maipp": maipp_version(),
        "planner": setup.planner,
        "seed": setup.seed,
        "robots": list(setup.robots),
        "epoch": setup.units.epoch,
        "mission": setup.digest(world),
    } | ({"keys": setup.keys} if setup.keys else {})


def maipp_version() -> str:
    """The version installed."""
    try:
        return version("maipp")
    except PackageNotFoundError:  # run from a source tree
        return "unknown"
