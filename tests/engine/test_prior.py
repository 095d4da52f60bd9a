"""Surveys with prior samples: what agents believe and what is scored rests on them, and without any nothing changes."""

import dataclasses
import re
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern

from maipp.engine import draw_missions, run_missions
from maipp.engine.episode import Episode, replay
from maipp.engine.observe import knowledge, observe
from maipp.engine.prior_checks import prior_arrays
from maipp.engine.score import pooled_belief, score_missions, trace_over_time
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.planners.random_walk import RandomWalk
from maipp.problem import shape_of
from maipp.scenario import Scenario

SCENARIO = Scenario.create(agents=2, budget=1.0, grid=8, nodes=12, neighbours=4, comm_range=0.3, threshold=0.3)
SAMPLES = 12
SLOTS = SCENARIO.measurements


def samples():
    """Old samples in three quarters of the domain, two of them in one place, with noise of their own."""
    rng = np.random.default_rng(8)
    x = rng.uniform(0.0, 0.75, (SAMPLES, 2))
    x[1] = x[0]
    return (x, rng.normal(0.3, 0.2, SAMPLES)), np.geomspace(1e-4, 1e-1, SAMPLES)


def survey(prior=None, noise=None, scenario=SCENARIO):
    missions = draw_missions(scenario, seed=5, instances=2, prior=prior, prior_noise=noise)
    return missions, run_missions(RandomWalk(scenario), missions, jax.random.key(5))


@pytest.fixture(scope="module")
def bare():
    return survey()


@pytest.fixture(scope="module")
def finished():
    return survey(*samples())


@pytest.fixture(scope="module")
def episode(finished):
    return Episode.from_state(SCENARIO, "random", {}, 5, *finished, index=1)


def reference(x, y):
    """Mean and variance on the grid in float64 from the samples and these measurements."""
    (sample_x, sample_y), noise = samples()
    alpha = np.concatenate([noise, np.full(len(y), SCENARIO.noise)])
    kernel = Matern(SCENARIO.length_scale, nu=1.5)
    process: Any = GaussianProcessRegressor(kernel, alpha=alpha, optimizer=None)  # type: ignore[arg-type]
    line = np.linspace(0, 1, 8)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    mean, std = process.fit(np.concatenate([sample_x, x]), np.concatenate([sample_y, y])).predict(grid, return_std=True)
    return mean, std**2


def trace(mean, variance):
    return variance[mean + np.sqrt(variance) >= 0.3].sum()


def of(tree, index):
    return jax.tree.map(lambda a: np.asarray(a[index]), tree)


def test_scores_rest_on_samples_and_measurements(finished):
    missions, states = finished
    metrics = score_missions(missions, states)
    for i in range(2):
        world, end = of(missions, i), of(states, i)
        taken = np.isfinite(end.measurement_time)
        mean, variance = reference(end.measurement_x[taken], end.measurement_y[taken])
        assert float(metrics.trace[i]) == pytest.approx(trace(mean, variance), rel=2e-3)
        assert float(metrics.true_trace[i]) == pytest.approx(variance[world.truth >= 0.3].sum(), rel=2e-3)
        assert float(metrics.rmse[i]) == pytest.approx(np.sqrt(((mean - world.truth) ** 2).mean()), rel=2e-3)
        own = [trace(*reference(end.measurement_x[known], end.measurement_y[known])) for known in end.known]
        assert float(metrics.own_trace[i]) == pytest.approx(np.mean(own), rel=2e-3)


@pytest.mark.parametrize("capacity", [512, 8])
def test_an_agent_believes_what_the_samples_tell_besides_what_it_knows(finished, capacity):
    """With a capacity below the 12 samples the tiles give the same, as they hold all of so small a survey."""
    mission, state = (jax.tree.map(lambda a: a[1], tree) for tree in finished)
    mission = dataclasses.replace(mission, shape=shape_of(SCENARIO.replace(belief_capacity=capacity)))

    @eqx.filter_jit
    def see(agent):
        return observe(mission, knowledge(mission, state, agent, jnp.zeros(2, bool)))

    for agent in range(2):
        saw = see(jnp.asarray(agent))
        known = np.asarray(state.known[agent])
        mean, variance = reference(np.asarray(state.measurement_x)[known], np.asarray(state.measurement_y)[known])
        np.testing.assert_allclose(saw.belief.mean, mean, atol=2e-3)
        np.testing.assert_allclose(saw.belief.variance, variance, atol=1e-3)
        assert saw.belief.x.shape[0] == min(capacity, SLOTS + SAMPLES)
        np.testing.assert_array_equal(saw.known[:SLOTS], known.reshape(-1))
        assert np.asarray(saw.known[SLOTS:]).all()
        (x, y), _ = samples()
        np.testing.assert_array_equal(saw.measurement_x[SLOTS:], x.astype(np.float32))
        np.testing.assert_array_equal(saw.measurement_y[SLOTS:], y.astype(np.float32))


def test_before_any_measurement_the_samples_are_all_that_is_known(finished, episode):
    mission, state = (jax.tree.map(lambda a: a[1], tree) for tree in finished)
    start = trace(*reference(np.empty((0, 2)), np.empty(0)))
    assert start < 60  # of 64 without samples
    curve = trace_over_time(mission, state, jnp.asarray([0.0, jnp.inf]))
    assert float(curve[0]) == pytest.approx(start, rel=1e-3)
    assert episode.metrics.curve_trace[0] == pytest.approx(start, rel=1e-3)
    assert float(curve[1]) == pytest.approx(episode.metrics.trace, rel=1e-3)


def test_the_record_agrees_with_the_simulation(finished, episode):
    missions, states = finished
    scores, metrics = score_missions(missions, states), replay(episode)
    assert metrics.trace == pytest.approx(float(scores.trace[1]), rel=1e-4)
    assert metrics.own_trace.mean() == pytest.approx(float(scores.own_trace[1]), rel=1e-4)
    assert metrics.true_trace == pytest.approx(float(scores.true_trace[1]), rel=1e-4)
    assert metrics.rmse == pytest.approx(float(scores.rmse[1]), rel=1e-4)
    alone = replay(dataclasses.replace(episode, prior=None))
    assert alone.trace > metrics.trace and alone.mutual_information > metrics.mutual_information
    pooled = eqx.filter_jit(pooled_belief)(*(jax.tree.map(lambda a: a[1], tree) for tree in finished))
    ends = episode.beliefs(np.array([np.inf]))
    np.testing.assert_allclose(ends.mean[0], pooled.mean, atol=1e-4)
    np.testing.assert_allclose(ends.variance[0], pooled.variance, atol=1e-4)


def test_mutual_information_is_that_of_the_posterior_covariance(episode):
    taken = [np.concatenate([getattr(a, name) for a in episode.agents]) for name in ("measurement_x", "measurement_y")]
    (sample_x, _), noise = samples()
    x = np.concatenate([taken[0], sample_x])
    line = np.linspace(0, 1, 8)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    matern = Matern(SCENARIO.length_scale, nu=1.5)
    gram = np.asarray(matern(x)) + np.diag(np.concatenate([np.full(len(taken[1]), SCENARIO.noise), noise]))
    cross = np.asarray(matern(x, grid))
    area = episode.beliefs(np.array([np.inf])).area[0]
    covariance = (np.asarray(matern(grid)) - cross.T @ np.linalg.solve(gram, cross))[np.ix_(area, area)]
    wanted = 0.5 * np.linalg.slogdet(0.01 * covariance + np.eye(area.sum()))[1]
    assert episode.metrics.mutual_information == pytest.approx(wanted, rel=1e-3)


def test_no_samples_are_the_same_as_none(bare):
    missions, states = survey((np.empty((0, 2)), np.empty(0)), 0.1)
    assert missions.prior is None and missions.prior_noise is None
    for found, wanted in zip(jax.tree.leaves((missions, states)), jax.tree.leaves(bare), strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_samples_change_what_is_believed_but_not_the_world(bare, finished):
    prior, noise = samples()
    for name in ("truth", "start", "inside"):
        np.testing.assert_array_equal(getattr(finished[0], name), getattr(bare[0], name))
    # A random walk asks no belief: it goes the same way, and what was measured there tells more.
    np.testing.assert_array_equal(finished[1].route, bare[1].route)
    assert finished[0].prior_x.shape == (2, SAMPLES, 2) and finished[0].prior_noise.shape == (2, SAMPLES)
    without, with_samples = (first_pooled(*each).variance for each in (bare, finished))
    assert (np.asarray(with_samples) <= np.asarray(without) + 1e-5).all()
    same = draw_missions(SCENARIO, seed=5, instances=1, trials=2, prior=prior, prior_noise=0.2)
    np.testing.assert_array_equal(same.prior_y, np.broadcast_to(prior[1].astype(np.float32), (2, SAMPLES)))
    np.testing.assert_array_equal(same.prior_noise, np.full((2, SAMPLES), np.float32(0.2)))


@eqx.filter_jit
def first_pooled(missions, states):
    return pooled_belief(*(jax.tree.map(lambda a: a[0], tree) for tree in (missions, states)))


def test_without_noise_of_their_own_samples_have_the_scenario_s(finished):
    prior, _ = samples()
    missions, states = finished
    same = eqx.tree_at(lambda m: m.prior_noise, missions, jnp.full((2, SAMPLES), SCENARIO.noise))
    silent = eqx.tree_at(lambda m: m.prior_noise, missions, None)
    assert silent.prior is not None and silent.prior.noise is None
    for found, wanted in zip(
        jax.tree.leaves(score_missions(silent, states)),
        jax.tree.leaves(score_missions(same, states)),
        strict=True,
    ):
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-4)
    assert prior[0].shape == (SAMPLES, 2)


def test_robots_go_where_old_samples_are_not():
    """The west is known to hold nothing; of what the robots may measure, little lies there."""
    scenario = Scenario.create(agents=2, budget=1.0, grid=8, nodes=40, neighbours=6, start=[0.5, 0.5])
    planner = make_planner("shared-greedy", scenario)
    x = np.stack(np.meshgrid(np.linspace(0, 0.45, 4), np.linspace(0, 1, 7), indexing="ij"), axis=-1).reshape(-1, 2)
    west = []
    for prior in (None, (x, np.zeros(len(x)))):
        missions = draw_missions(scenario, seed=2, instances=6, prior=prior)
        states = run_missions(planner, missions, jax.random.key(0))
        measured = np.isfinite(states.measurement_time)
        west.append((np.asarray(states.measurement_x)[measured][:, 0] < 0.45).mean())
    assert west[0] > 0.3 and west[1] < 0.1


NAN = [np.nan, 1.0]


@pytest.mark.parametrize(
    ("prior", "noise", "message"),
    [
        (
            ([[0.1, 0.2]], [1.0, 2.0]),
            None,
            "prior: positions (1, 2) and values (2,) do not match; give (p, 2) and (p,)",
        ),
        (([0.1, 0.2], [1.0]), None, "prior: positions (2,) and values (1,) do not match; give (p, 2) and (p,)"),
        (([[0.1, 0.2]], [[1.0]]), None, "prior: positions (1, 2) and values (1, 1) do not match"),
        (([[0.1, 0.2], NAN], [1.0, 2.0]), None, "prior_x: sample 1 is not a finite number"),
        (([[0.1, 0.2], [0.3, 0.4]], NAN), None, "prior_y: sample 0 is not a finite number"),
        (([[0.1, 0.2]], [1e300]), None, "prior_y: sample 0 is not a finite number"),
        (([[0.1, 0.2]], [1.0]), -0.1, "prior_noise: goes below 0"),
        (([[0.1, 0.2]], [1.0]), np.nan, "prior_noise: sample 0 is not a finite number"),
        (([[0.1, 0.2]], [1.0]), [0.1, 0.2], "prior_noise: has shape (2,); give one number, or one for each of the 1"),
    ],
)
def test_what_is_wrong_with_samples_is_said_in_one_line(prior, noise, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}") as caught:
        prior_arrays(prior, noise)
    assert "\n" not in str(caught.value)
