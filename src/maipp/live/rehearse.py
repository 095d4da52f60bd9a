"""Rehearsals with the kernel refitted under way: the live survey itself, with robots that do as they are told."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Interest
from maipp.engine.area_found import area_found
from maipp.kept import kept
from maipp.live.belief_query import believe
from maipp.live.live_survey import LiveSurvey
from maipp.live.simulate import simulate
from maipp.surveys.standardise import PreparedSurvey
from maipp.typing import Array, Float


@kept
def _values(field: Any, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
    return field(points)


def refitted(prepared: PreparedSurvey, fields: Any, count: int, seed: int) -> dict[str, Any]:
    """How a team fares on each of the fields (a pytree with a leading axis of `count`): standardised, domain units.

    Every key has `count` values: trace, rmse, found, distance and longest, as in a rehearsal's `Outcome`.
    """
    rows = [_rehearsed(prepared, jax.tree.map(lambda a, i=index: a[i], fields), seed + index) for index in range(count)]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def _rehearsed(prepared: PreparedSurvey, field: Any, seed: int) -> dict[str, float]:
    """How a team fares on one field."""

    def truth(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        return np.asarray(_values(field, jnp.asarray(points, jnp.result_type(float))))

    with LiveSurvey.from_prepared(prepared, seed=seed) as survey:
        simulate(survey, truth, seed)
        world, measurements = survey.world, survey._measurements
        grid, inside = np.asarray(world.mission.grid), np.asarray(world.mission.inside)
        mean, std = believe(world.mission, measurements, grid)
        problem, (level, scale) = (
            world.known(measurements.kernel, survey.setup.beta_follows).mission.problem,
            measurements.standard,
        )
        interest = Interest(problem.threshold, problem.beta, problem.interest_rule)
        values, threshold = truth(grid), prepared.scenario.threshold
        area = area_found(values >= threshold, mean >= threshold, inside)
        trace = interest.trace(*map(jnp.asarray, ((mean - level) / scale, (std / scale) ** 2, inside)))
        return {
            "trace": float(trace) * scale**2,
            "rmse": float(np.sqrt(np.mean((mean - values)[inside] ** 2))),
            "found": float(np.divide(area.both, area.true)) if area.true else math.nan,
            "distance": float(sum(robot.odometer for robot in survey._robots)),
            "longest": max(robot.time for robot in survey._robots),
        }
