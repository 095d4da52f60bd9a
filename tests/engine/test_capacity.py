"""Surveys whose agents have beliefs of limited capacity."""

import jax
import numpy as np
import pytest

from maipp.engine import draw_missions, run_missions
from maipp.engine.score import score_missions
from maipp.planners import make_planner
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=3, budget=1.0, grid=8, nodes=20, neighbours=6)


def survey(capacity):
    """Final states and metrics of a few surveys."""
    scenario = SCENARIO.replace(belief_capacity=capacity)
    planner = make_planner("shared-greedy", scenario)
    missions = draw_missions(scenario, seed=0, instances=4)
    states = run_missions(planner, missions, jax.random.key(1))
    return states, score_missions(missions, states)


@pytest.fixture(scope="module")
def exact():
    return survey(SCENARIO.measurements)


def test_a_capacity_that_suffices_changes_nothing(exact):
    for found, wanted in zip(jax.tree.leaves(survey(10**6)), jax.tree.leaves(exact), strict=True):
        np.testing.assert_array_equal(found, wanted)  # NaN, what an agent that has stopped tells, equals NaN


def test_a_survey_of_more_measurements_than_fit_goes_about_as_well(exact):
    """The tiles of so small a survey hold all of it, so only the look-ahead is short of measurements."""
    states, metrics = survey(6)
    assert not states.active.any() and np.isfinite(states.measurement_time).any(axis=2).all()
    assert float(metrics.trace.mean()) < 1.5 * float(exact[1].trace.mean())
