"""`sga-catnipp`: the announced next nodes count as measured, and no intent does anything."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from sklearn.gaussian_process.kernels import Matern

from maipp.engine import draw_missions, reset
from maipp.engine.observe import due_agent, hear, knowledge, observe
from maipp.engine.rollout import step
from maipp.planners.paths.path_sampler import log_probability
from maipp.planners.sga_catnipp import SgaCatnipp
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=3, budget=(0.7, 0.6, 0.4), grid=8, nodes=24, neighbours=6)
KEY = jax.random.key(0)
EVENTS = 30


@eqx.filter_jit
def _events(planner, mission):
    def event(state, _):
        agent = due_agent(mission, state)
        now = jnp.where(state.active.any(), state.arrival[agent], state.time)
        there = eqx.tree_at(lambda s: s.time, state, jnp.maximum(state.time, now))
        there, heard = hear(mission, there, agent)
        observation = observe(mission, knowledge(mission, there, agent, heard))
        memory = jax.tree.map(lambda a: a[agent], state.memory)
        decided = planner.act(jax.random.fold_in(KEY, state.events), observation, memory)
        return step(planner, mission, state, KEY), (observation, *decided, state.active.any())

    return lax.scan(event, reset(planner, mission), length=EVENTS)


@pytest.fixture(scope="module")
def events(tiny):
    """The final state of a mission; what its agents saw, decided and told a trainer; and which events there were."""
    mission = jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=6, instances=1, encodings=4))
    return jax.tree.map(np.asarray, _events(SgaCatnipp.of(SCENARIO, network=tiny, choose="sample"), mission))


def test_the_next_node_is_told_until_the_agent_stops(events):
    state, (_, decision, _, running) = events
    assert running[:9].all() and not running[-1] and not state.active.any()
    going = running & ~decision.stop
    np.testing.assert_array_equal(decision.message[going], decision.waypoints[going, 0])
    assert np.isnan(decision.message[decision.stop]).all() and (decision.stop & running).sum() == 3
    assert np.isnan(state.messages).all()


def test_the_policy_sees_a_belief_that_counts_the_announced_nodes(events):
    _, (seen, _, choice, running) = events
    counted = 0
    for e in np.flatnonzero(running):
        nodes = seen.roadmap.nodes[e].astype(np.float64)
        told = seen.messages[e][seen.heard[e] & np.isfinite(seen.messages[e]).all(axis=1)]
        x = np.concatenate([seen.measurement_x[e][seen.known[e]], told])
        variance = np.ones(len(nodes))
        if len(x):
            joint = np.asarray(Matern(SCENARIO.length_scale, nu=1.5)(np.concatenate([x, nodes])))
            gram, cross = joint[: len(x), : len(x)] + 1e-6 * np.eye(len(x)), joint[: len(x), len(x) :]
            variance = 1.0 - np.sum(cross * np.linalg.solve(gram, cross), axis=0)
        np.testing.assert_allclose(choice.view.features[e, :, 3] ** 2, variance, atol=3e-3)
        counted += len(told)
        assert (choice.view.features[e, :, 4] == 0).all()  # no intents
    assert counted > 8


def test_choices_are_allowed_neighbours_and_their_probability_is_told(events, tiny):
    _, (seen, decision, choice, running) = events

    @eqx.filter_jit
    def logits(network, view, memory):
        prepared = network.prepare(network.encode(view.features, view.encoding))
        return network.decode(prepared, *view[2:], memory)[0]

    device = jax.tree.map(jnp.asarray, (choice.view, choice.memory))
    rows = np.asarray(jax.vmap(logits, (None, 0, 0))(tiny, *device), np.float64)
    told = jax.vmap(log_probability)(jnp.asarray(choice.insight.logits), jnp.asarray(choice.index))
    for e in np.flatnonzero(running & ~decision.stop):
        index = choice.index[e]
        assert choice.view.allowed[e, index]
        target = seen.roadmap.nodes[e][choice.view.neighbours[e, index]]
        np.testing.assert_array_equal(decision.waypoints[e, 0], target)
        assert told[e] == pytest.approx(rows[e, index] - np.logaddexp.reduce(rows[e]), abs=1e-4)
