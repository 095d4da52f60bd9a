"""Metrics of finished missions, from their definitions."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sklearn.gaussian_process.kernels import Matern

from maipp.engine import draw_missions, reset, run_missions
from maipp.engine.area_found import found_by
from maipp.engine.episode import Episode
from maipp.engine.episode_io import dump_episode
from maipp.engine.finite import instance_and_trial
from maipp.engine.score import interest_of, pooled_belief, score_missions, trace_over_time
from maipp.engine.state import BY_PLANNER, NOT_FINITE, RECORD_FULL, SPENT, TRAVELLING
from maipp.errors import InputError
from maipp.planners.random_walk import RandomWalk
from maipp.scenario import Scenario

WALL = ((0.4, 0.2), (0.6, 0.2), (0.6, 0.6), (0.4, 0.6))
SCENARIO = Scenario(
    agents=3,
    budget=(1.0, 0.7, 0.4),
    speed=(1.0, 0.83, 0.71),  # no two measurements at the same time
    comm_range=0.25,
    start=((0.1, 0.1), (0.9, 0.9), (0.2, 0.1)),
    grid=10,
    nodes=20,
    neighbours=5,
    obstacles=(WALL,),
    threshold=0.3,
    beta=0.5,
)


@pytest.fixture(scope="module")
def finished():
    """Two missions and their final states."""
    missions = draw_missions(SCENARIO, seed=1, instances=2)
    return missions, run_missions(RandomWalk(SCENARIO), missions, jax.random.key(0))


def mean_and_variance(x, y, grid):
    """The posterior in NumPy; the noise is negligible here."""
    matern = Matern(SCENARIO.length_scale, nu=1.5)
    joint = np.asarray(matern(np.concatenate([x, grid])))
    count = len(x)
    cross = joint[:count, count:]
    weights = np.linalg.solve(joint[:count, :count] + SCENARIO.noise * np.eye(count), cross)
    return y @ weights, 1.0 - np.sum(cross * weights, axis=0)


def trace(mean, variance, inside):
    return variance[(mean + 0.5 * np.sqrt(np.maximum(variance, 0)) >= 0.3) & inside].sum()


def test_metrics_are_their_definitions(finished):
    missions, states = finished
    metrics = score_missions(missions, states)
    for i in range(2):
        world, end = (jax.tree.map(lambda a, i=i: np.asarray(a[i]), tree) for tree in (missions, states))
        taken = np.isfinite(end.measurement_time)
        assert 3 < taken.sum() < taken.size  # some slots stay empty
        mean, variance = mean_and_variance(end.measurement_x[taken], end.measurement_y[taken], world.grid)
        assert not world.inside.all()
        assert float(metrics.trace[i]) == pytest.approx(trace(mean, variance, world.inside), rel=1e-3)
        high = (world.truth >= 0.3) & world.inside
        assert ((world.truth >= 0.3) & ~world.inside).any()
        assert float(metrics.true_trace[i]) == pytest.approx(variance[high].sum(), rel=1e-3)
        error = (mean - world.truth)[world.inside]
        assert float(metrics.rmse[i]) == pytest.approx(np.sqrt((error**2).mean()), rel=1e-3)
        own = []
        for agent in range(3):
            known = end.known[agent]
            assert not (known & ~taken).any()
            assert (known[agent] == taken[agent]).all()  # at its end an agent knows all of its own measurements
            values = mean_and_variance(end.measurement_x[known], end.measurement_y[known], world.grid)
            own.append(trace(*values, world.inside))
        assert not np.allclose(own, own[0], rtol=1e-3)
        assert float(metrics.own_trace[i]) == pytest.approx(np.mean(own), rel=1e-3)
        assert float(metrics.distance[i]) == pytest.approx(end.odometer.sum(), rel=1e-6)
        assert float(metrics.decisions[i]) == end.events


def test_trace_over_time_starts_at_the_prior_and_ends_at_the_result(finished):
    missions, states = finished
    mission, state = (jax.tree.map(lambda a: a[1], tree) for tree in (missions, states))
    measured = np.asarray(state.measurement_time)
    moments = np.unique(measured[np.isfinite(measured)])
    times = np.concatenate([[0.0], moments - 1e-4, moments, [np.inf]]).astype(np.float32)
    curve = np.asarray(trace_over_time(mission, state, jnp.asarray(times)))
    inside = float(np.asarray(mission.inside).sum())
    assert curve[0] == inside  # 900 on the paper's grid: before any measurement everything is of high interest
    assert curve[-1] == pytest.approx(float(score_missions(missions, states).trace[1]), rel=1e-4)
    before, after = curve[1 : len(moments) + 1], curve[len(moments) + 1 : -1]
    assert before[0] == inside
    np.testing.assert_allclose(before[1:], after[:-1], rtol=1e-5)  # it changes at measurements only
    assert (np.abs(after - before) > 1e-3).all()


def test_the_paper_starts_at_900():
    scenario = Scenario()
    missions = draw_missions(scenario, seed=0, instances=1, roadmaps=False)
    before = jax.vmap(partial(reset, RandomWalk(scenario)))(missions)
    metrics = score_missions(missions, before)
    assert float(metrics.trace[0]) == float(metrics.own_trace[0]) == 900.0
    assert float(metrics.distance[0]) == 0.0


def test_pooled_belief_at_a_time_holds_what_was_measured_by_then(finished):
    missions, states = finished
    mission, state = (jax.tree.map(lambda a: a[0], tree) for tree in (missions, states))
    times = np.sort(np.asarray(state.measurement_time).ravel())
    mask = eqx.filter_jit(lambda time: pooled_belief(mission, state, time).mask)
    for k in (0, 2):
        assert int(mask(jnp.asarray(times[k])).sum()) == k + 1
    assert not mask(jnp.asarray(0.0)).any()
    assert int(mask(jnp.asarray(np.inf)).sum()) == np.isfinite(times).sum()


def test_interest_is_the_scenarios():
    interest = interest_of(SCENARIO.replace(interest_rule="variance"))
    assert (interest.threshold, interest.beta, interest.rule) == (0.3, 0.5, "variance")


def broken(finished, what):
    """The same missions, the second of them with one number of NaN."""
    missions, states = finished
    if what == "value":
        return missions, eqx.tree_at(lambda s: s.measurement_y, states, states.measurement_y.at[1, 0, 0].set(jnp.nan))
    if what == "place":
        return missions, eqx.tree_at(lambda s: s.measurement_x, states, states.measurement_x.at[1, 0, 0].set(jnp.nan))
    spot = int(np.argmax(np.asarray(missions.inside[1])))
    return eqx.tree_at(lambda m: m.truth, missions, missions.truth.at[1, spot].set(jnp.nan)), states


@pytest.mark.parametrize("what", ["value", "place", "truth"])
def test_a_mission_that_is_not_a_number_is_refused_with_its_number(finished, what):
    with pytest.raises(InputError, match=r"^mission 1: .* is nan, not a finite number") as told:
        score_missions(*broken(finished, what))
    assert "\n" not in str(told.value)
    with pytest.raises(InputError, match="^instance 2, trial 3: "):
        score_missions(*broken(finished, what), name=instance_and_trial(4, 10))


def test_an_episode_that_is_not_a_number_is_refused_with_its_number(finished):
    missions, states = broken(finished, "value")
    episode = Episode.from_state(SCENARIO, "random", {}, 1, missions, states, index=1)
    for use in (dump_episode, found_by, lambda episode: episode.metrics):
        with pytest.raises(InputError, match="^mission 1 of seed 1: the mean is nan"):
            use(episode)
    dump_episode(Episode.from_state(SCENARIO, "random", {}, 1, missions, states, index=0))


def test_unspent_is_what_the_engine_left_of_the_budgets(finished):
    """Agents of the random walk travel their budgets; then one is stopped for each of the engine's reasons."""
    missions, states = finished
    metrics = score_missions(missions, states)
    left = np.asarray(missions.params.budgets) - np.asarray(states.odometer)
    np.testing.assert_allclose(metrics.unspent, left.mean(axis=1), atol=1e-5)
    np.testing.assert_array_equal(metrics.unspent, 0.0)
    assert not metrics.not_finite.any() and not metrics.record_full.any()
    stopped = jnp.array([[SPENT, NOT_FINITE, NOT_FINITE], [RECORD_FULL, BY_PLANNER, TRAVELLING]], jnp.int8)
    changed = eqx.tree_at(lambda s: (s.status, s.odometer), states, (stopped, states.odometer / 2))
    metrics = score_missions(missions, changed)
    np.testing.assert_array_equal(metrics.not_finite, [2, 0])
    np.testing.assert_array_equal(metrics.record_full, [0, 1])
    np.testing.assert_allclose(metrics.unspent, np.mean(SCENARIO.budgets) / 2, rtol=1e-5)
