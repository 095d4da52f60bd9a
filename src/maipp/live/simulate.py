"""A live survey with robots that do as they are told, in a field that is known: what it would come to."""

import heapq
import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from maipp.engine.polyline import followed, place_at
from maipp.live.events import Arrived, Measurement
from maipp.typing import Float

if TYPE_CHECKING:
    from maipp.live.live_survey import LiveSurvey

Field = Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, " n"]]


def simulate(survey: "LiveSurvey", field: Field, seed: int) -> int:
    """Run the survey to its end; the number of decisions.

    `field` gives standardised values at domain positions; measurements of it have the scenario's noise, drawn from the
    seed. The survey has all of them afterwards, and can be asked for its belief.
    """
    units, scenario = survey.setup.units, survey.world.scenario
    rng, number = np.random.default_rng(seed), itertools.count()
    speeds = dict(zip(survey.setup.robots, scenario.speeds, strict=True))
    starts = np.asarray(survey.world.mission.start, np.float64)
    due: list[tuple[float, int, str, bool, np.ndarray]] = []  # time, order, robot, whether it measures, where
    for robot, start in zip(survey.setup.robots, starts, strict=True):
        heapq.heappush(due, (0.0, next(number), robot, False, start))
    decisions = 0
    while due:
        time, order, robot, measures, place = heapq.heappop(due)
        (position,) = units.points_out(place[None])
        head: dict[str, Any] = {"id": str(order), "robot": robot, "position": tuple(position)}
        head["time"] = units.time_out(time)
        if measures:
            value = float(field(place[None])[0]) + scenario.noise**0.5 * rng.standard_normal()
            survey.report(Measurement(**head, value=units.values_out(np.array([value]))[0]))
            continue
        answer = survey.report(Arrived(**head))
        decisions += 1
        if answer["answer"] == "stop":
            continue
        leg = np.concatenate(
            [place[None], [units.position("waypoints", tuple(point)) for point in answer["waypoints"]]]
        )
        length, along = float(np.hypot(*np.diff(leg, axis=0).T).sum()), 0.0
        for point in answer["measure"]:  # in order, so that a leg out and back is told apart
            next_one = np.array(units.position("measure", tuple(point)))
            along = followed(leg, next_one, along + scenario.measurement_interval)
            heapq.heappush(due, (time + along / speeds[robot], next(number), robot, True, place_at(leg, along)))
        heapq.heappush(due, (time + length / speeds[robot], next(number), robot, False, leg[-1]))
    return decisions
