"""What the network is shown at a decision."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine import draw_missions, reset
from maipp.engine.observe import knowledge, observe
from maipp.errors import InputError
from maipp.planners.paths.path_sampler import PathSampler, log_probability
from maipp.planners.sga_catnipp import SgaCatnipp
from maipp.policy import save_weights
from maipp.scenario import Scenario
from maipp.typing import Array

SCENARIO = Scenario(
    agents=1, budget=0.6, grid=6, nodes=24, neighbours=6, extent=(2.0, 1.0), threshold=0.3, last_leg="stop"
)


@pytest.fixture(scope="module")
def planner(tiny):
    return SgaCatnipp.of(SCENARIO, network=tiny)


@pytest.fixture(scope="module")
def observation(planner):
    """At the start, as if five values had been measured already and half the budget spent."""
    mission = jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=2, instances=1, encodings=4))
    state = reset(planner, mission)
    rng = np.random.default_rng(0)
    slots = min(5, SCENARIO.measurements_per_agent)
    state = eqx.tree_at(
        lambda s: (s.measurement_x, s.measurement_y, s.measurement_time, s.known_until, s.odometer),
        state,
        (
            state.measurement_x.at[0, :slots].set(jnp.asarray(rng.random((slots, 2)), jnp.float32)),
            state.measurement_y.at[0, :slots].set(jnp.asarray(rng.random(slots), jnp.float32)),
            state.measurement_time.at[0, :slots].set(0.0),
            jnp.zeros_like(state.known_until),
            state.odometer + 0.3,
        ),
    )
    return eqx.filter_jit(observe)(mission, knowledge(mission, state, jnp.int32(0), jnp.zeros(1, bool)))


def test_of_a_survey_beyond_the_capacity_the_nodes_are_predicted_with_the_grid(tiny):
    """Other tiles than the nodes by themselves would have, as near to the exact belief as these."""
    scenario = SCENARIO.replace(belief_capacity=8, budget=4.0)
    planner = SgaCatnipp.of(scenario, network=tiny)
    mission = jax.tree.map(lambda a: a[0], draw_missions(scenario, seed=2, instances=1, encodings=4))
    state = reset(planner, mission)
    rng = np.random.default_rng(0)
    x = jnp.asarray(rng.random(state.measurement_x.shape), jnp.float32)
    state = eqx.tree_at(
        lambda s: (s.measurement_x, s.measurement_y, s.measurement_time, s.known_until),
        state,
        (x, jnp.sin(6 * x[..., 0]), jnp.zeros_like(state.measurement_time), jnp.zeros_like(state.known_until)),
    )
    assert state.measurement_time.size > scenario.belief_capacity
    seen = eqx.filter_jit(observe)(mission, knowledge(mission, state, jnp.int32(0), jnp.zeros(1, bool)))
    assert seen.roadmap is not None and seen.at_nodes is not None
    nodes = seen.roadmap.nodes
    alone = eqx.filter_jit(lambda belief, points: belief.on(points))(seen.belief, nodes)
    assert seen.belief.query.shape == mission.grid.shape
    np.testing.assert_array_equal(seen.at_nodes.query, nodes)
    # So few measurements are all in every tile: both are exact but for rounding.
    np.testing.assert_allclose(seen.at_nodes.mean, alone.mean, atol=2e-3)
    np.testing.assert_allclose(seen.at_nodes.variance, alone.variance, atol=1e-4)


@eqx.filter_jit
def look(planner, observation, belief, intent):
    situation = planner.sampler.agent_state(observation, belief.on(observation.roadmap.nodes), intent)
    return situation, planner.sampler.look(situation, planner.initial_memory())


def test_the_network_is_shown_the_belief_the_budget_and_the_edges(planner, observation):
    intent = jnp.linspace(0, 1, SCENARIO.nodes)
    situation, insight = look(planner, observation, observation.belief, intent)
    view, roadmap = insight.view, observation.roadmap
    there = observation.belief.on(roadmap.nodes)
    x, y, shown_mean, shown_std, shown_intent = np.asarray(view.features).T
    np.testing.assert_allclose(np.stack([x, y], 1), (roadmap.nodes - observation.position) / 2.0, atol=1e-6)
    np.testing.assert_allclose(shown_mean, there.mean, atol=1e-5)
    np.testing.assert_allclose(shown_std**2, there.variance, atol=1e-5)
    np.testing.assert_array_equal(shown_intent, intent)
    np.testing.assert_array_equal(view.encoding, roadmap.encoding)
    assert int(view.node) == int(situation.here.node) == 0  # the start is node 0
    np.testing.assert_array_equal(view.neighbours, roadmap.neighbours[0])
    np.testing.assert_allclose(view.neighbour_std, shown_std[np.asarray(view.neighbours)])
    np.testing.assert_array_equal(view.allowed, roadmap.distances[0] <= 0.3)
    assert 0 < view.allowed.sum() < SCENARIO.neighbours
    assert float(view.remaining) == pytest.approx(0.3 / 2.0, abs=1e-6)  # longest sides of the extent
    assert float(view.threshold) == pytest.approx(0.3)
    assert np.isneginf(insight.logits[~view.allowed]).all() and np.isfinite(insight.logits[view.allowed]).all()


def test_another_network_sets_how_long_encodings_are(planner, tiny):
    assert planner.encoding_dimensions == tiny.encoding_dimensions == 4
    assert PathSampler(SCENARIO, weights="untrained").encoding_dimensions == 32


def test_weights_of_a_file_are_the_network(tiny, tmp_path):
    path = tmp_path / "mine.safetensors"
    save_weights(tiny, path, {})
    read = PathSampler(SCENARIO, weights=str(path)).policy
    for one, other in zip(jax.tree.leaves(read), jax.tree.leaves(tiny), strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(InputError, match="nowhere"):
        PathSampler(SCENARIO, weights=str(tmp_path / "nowhere.safetensors"))


def test_log_probability_is_that_of_a_softmax_and_zero_where_nothing_is_possible():
    logits = jnp.array([0.5, -jnp.inf, 2.0])
    chances = [float(jnp.exp(log_probability(logits, jnp.int32(i)))) for i in range(3)]
    assert chances[1] == 0 and sum(chances) == pytest.approx(1.0)
    assert chances[2] / chances[0] == pytest.approx(np.exp(1.5), rel=1e-5)
    nowhere = jnp.full(3, -jnp.inf)
    assert float(log_probability(nowhere, jnp.int32(1))) == 0.0

    def slope(logits: Array) -> Array:
        return jax.grad(lambda logits: log_probability(logits, jnp.int32(1)))(logits)

    assert np.isfinite(slope(nowhere)).all()
