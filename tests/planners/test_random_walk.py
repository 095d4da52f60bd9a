"""The random walk: uniform over the edges that the budget allows."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine import draw_missions, reset
from maipp.engine.observe import knowledge, observe
from maipp.planners.random_walk import RandomWalk
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=1, budget=1.0, grid=6, nodes=20, neighbours=6, last_leg="stop")
DRAWS = 3000


@pytest.fixture(scope="module")
def observation():
    """What the agent sees at its start."""
    mission = jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=0, instances=1))

    @jax.jit
    def see(mission):
        state = reset(RandomWalk(SCENARIO), mission)
        return observe(mission, knowledge(mission, state, jnp.asarray(0), jnp.zeros(1, bool)))

    return see(mission)


@eqx.filter_jit
def decide(planner, observation):
    keys = jax.random.split(jax.random.key(0), DRAWS)
    return jax.vmap(lambda key: planner.decide(key, observation, ()))(keys)


def with_budget(observation, remaining):
    return eqx.tree_at(lambda o: o.remaining, observation, jnp.asarray(remaining))


def chosen(observation, decisions):
    """How often each of the start's neighbours was chosen."""
    targets = np.asarray(observation.roadmap.nodes)[np.asarray(observation.roadmap.neighbours)[0]]
    same = np.isclose(np.asarray(decisions.waypoints), targets, atol=1e-6).all(axis=-1)
    assert (same.sum(axis=1) == 1).all()
    return same.sum(axis=0)


def test_every_neighbour_in_reach_is_as_likely(observation):
    decisions = decide(RandomWalk(SCENARIO), observation)
    assert not decisions.stop.any()
    counts = chosen(observation, decisions)
    np.testing.assert_allclose(counts, DRAWS / 6, atol=5 * np.sqrt(DRAWS / 6))


def test_edges_longer_than_the_budget_are_not_taken(observation):
    """The neighbours are sorted by distance; an edge of exactly what is left is within reach."""
    lengths = np.asarray(observation.roadmap.distances)[0]
    counts = chosen(observation, decide(RandomWalk(SCENARIO), with_budget(observation, lengths[2])))
    np.testing.assert_allclose(counts[:3], DRAWS / 3, atol=5 * np.sqrt(DRAWS / 3))
    np.testing.assert_array_equal(counts[3:], 0)
    short = decide(RandomWalk(SCENARIO), with_budget(observation, lengths[0] * 0.9))
    assert short.stop.all()


def test_the_last_leg_may_be_cut_by_the_budget_instead(observation):
    scenario = SCENARIO.replace(last_leg="cut")
    decisions = decide(RandomWalk(scenario), with_budget(observation, 0.01))
    assert not decisions.stop.any()
    assert (chosen(observation, decisions) > 0).all()
    assert decide(RandomWalk(scenario), with_budget(observation, 0.0)).stop.all()


def test_blocked_edges_and_edges_to_the_same_place_are_not_taken(observation):
    """A step of length zero would end the mission."""
    roadmap = observation.roadmap
    blocked = eqx.tree_at(lambda o: o.roadmap.reachable, observation, roadmap.reachable.at[0, 1].set(False))
    twin = eqx.tree_at(lambda o: o.roadmap.distances, blocked, roadmap.distances.at[0, 4].set(0.0))
    counts = chosen(observation, decide(RandomWalk(SCENARIO), twin))
    np.testing.assert_array_equal(np.flatnonzero(counts == 0), [1, 4])
