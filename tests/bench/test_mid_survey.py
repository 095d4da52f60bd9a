"""The made-up survey: routes that a robot could have travelled, and a team that is due with all of it known."""

import jax
import numpy as np
import pytest

from maipp.bench.belief_error import walks
from maipp.bench.scaling import under_way
from maipp.engine.observe import turn
from maipp.planners import make_planner
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=3, budget=1.2, grid=6, nodes=12, neighbours=4)
COUNT = 4


def test_walks_stay_in_the_domain_and_measure_at_every_interval():
    visited = walks(np.random.default_rng(0), 50, 40, 0.2)
    assert visited.shape == (50, 40, 2) and (visited >= 0).all() and (visited <= 1).all()
    steps = np.linalg.norm(np.diff(visited, axis=1), axis=-1)
    assert (steps <= 0.2 + 1e-12).all()
    assert np.isclose(steps, 0.2).mean() > 0.4  # the others are mirrored at a border, where many linger


@pytest.mark.parametrize("name", ["shared-greedy", "lawnmower"])
def test_everybody_is_due_and_knows_what_everybody_has_measured(name):
    planner = make_planner(name, SCENARIO)
    mission, state = under_way(SCENARIO, planner, seed=1, count=COUNT)
    after, agent, observation = jax.jit(lambda m, s: turn(m, s))(mission, state)
    assert int(agent) == 0 and int(observation.known.sum()) == 3 * COUNT
    assert float(observation.remaining) == pytest.approx(1.2 - COUNT * 0.2, abs=1e-5)
    assert float(observation.to_next_measurement) == pytest.approx(0.2, abs=1e-5)
    assert float(after.time) == pytest.approx(COUNT * 0.2, abs=1e-5)
    truth = np.asarray(mission.field(state.measurement_x[0, :COUNT]))
    np.testing.assert_allclose(state.measurement_y[0, :COUNT], truth, atol=1e-6)
