"""What an agent travels of its first leg before it plans again, and what is left of its plan."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.engine import draw_missions, run_missions
from maipp.planners import make_planner
from maipp.planners.plane.walks import bend, walk_bent
from maipp.planners.search.first_leg import FirstLeg, depart
from maipp.scenario import Scenario

EXTENT, STEPS = (1.0, 1.0), jnp.asarray([0.2, 0.2, 0.2])
inner = st.floats(-0.7, 0.7)
plans = st.lists(st.tuples(inner, inner), min_size=3, max_size=3)


@jax.jit
def departed(position, plan, share):
    """The leg planned, and what `depart` says of it."""
    points = walk_bent(position, plan, STEPS, EXTENT)
    leg = FirstLeg(jnp.stack([bend(position, points[0], STEPS[0], EXTENT), points[0]]), points, plan)
    return leg, depart(position, leg, STEPS, share)


@jax.jit
def walked(position, plan, steps):
    return walk_bent(position, plan, steps, EXTENT)


@given(place=st.tuples(st.floats(0.3, 0.7), st.floats(0.3, 0.7)), plan=plans, share=st.floats(0.02, 0.19))
def test_the_rest_of_a_leg_goes_where_the_whole_leg_went(place, plan, share):
    position = np.asarray(place, np.float32)
    leg, (way, left) = departed(position, np.asarray(plan, np.float32), np.float32(share))
    assert np.linalg.norm(np.diff([position, *way], axis=0), axis=1).sum() == pytest.approx(share, abs=2e-6)
    assert np.linalg.norm(left[0]) <= 1 + 1e-4  # what is left of the leg is long enough
    rest = np.asarray([0.2 - share, 0.2, 0.2], np.float32)
    np.testing.assert_allclose(walked(way[-1], left, rest), leg.points, atol=1e-5)


@given(plan=plans, share=st.floats(0.2, 1.0))
def test_at_the_end_of_a_leg_the_others_are_left(plan, share):
    leg, (way, left) = departed(np.asarray([0.5, 0.5], np.float32), np.asarray(plan, np.float32), np.float32(share))
    np.testing.assert_array_equal(way, leg.way)
    np.testing.assert_allclose(left[:2], leg.plan[1:], atol=1e-30)  # subnormal numbers may come out as zero


@pytest.mark.slow
@pytest.mark.parametrize("name", ["receding-horizon", "intent-search"])
def test_planning_again_on_the_way_moves_no_measurement_off_its_distance(name):
    scenario = Scenario(agents=2, budget=0.9, grid=8, nodes=24, neighbours=6)
    options = {"horizon": 2, "candidates": 16, "elites": 2, "steps": 3}
    taken = []
    for decisions in (1, 3):
        planner = make_planner(name, scenario, options | {"decisions": decisions})
        missions = draw_missions(scenario, seed=3, instances=2, planner=planner)
        states = run_missions(planner, missions, jax.random.key(2))
        taken.append(np.asarray(states.events))
        measured = np.isfinite(np.asarray(states.measurement_time)).sum(axis=(1, 2))
        np.testing.assert_array_equal(measured, 2 * 4)  # one each at 0.2, 0.4, 0.6 and 0.8
    # Legs 0.2, 0.2, 0.2, 0.2 and the last 0.1, which is 2 thirds of a leg.
    assert (taken[1] - taken[0] >= 2 * 2 * 4).all()
