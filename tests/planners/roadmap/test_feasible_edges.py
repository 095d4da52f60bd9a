"""The edges an agent may take, and the one that leads out of a dead end: against SciPy's shortest ways."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from maipp.engine import draw_missions, reset
from maipp.engine.observe import knowledge, observe
from maipp.planners.random_walk import RandomWalk
from maipp.planners.roadmap.edges import edges, feasible_edges, roadmap_of
from maipp.roadmap import nearest_node
from maipp.scenario import Scenario

BAY = ((0.3, 0.3), (0.7, 0.3), (0.7, 0.35), (0.35, 0.35), (0.35, 0.65), (0.7, 0.65), (0.7, 0.7), (0.3, 0.7))
AMONG = Scenario(agents=2, budget=2.0, grid=6, nodes=60, neighbours=6, start=(0.45, 0.5), obstacles=(BAY,))
OPEN = AMONG.replace(obstacles=())
SLOTS = AMONG.measurements_per_agent
INTERVAL = AMONG.measurement_interval


@pytest.fixture(scope="module")
def observed():
    """What the first agent sees at its start in the bay, among zones and without."""
    seen = {}
    for scenario in (AMONG, OPEN):
        mission = jax.tree.map(lambda a: a[0], draw_missions(AMONG, seed=0, instances=1))
        state = reset(RandomWalk(scenario), mission)
        seen[scenario] = observe(mission, knowledge(mission, state, jnp.asarray(0), jnp.zeros(2, bool)))
    return seen


@eqx.filter_jit
def both(scenario, observation):
    """The edges that lead on, and all that the budget allows."""
    roadmap = roadmap_of(observation)
    node = nearest_node(roadmap, observation.position)
    return feasible_edges(scenario, observation), edges(roadmap, node, observation.remaining, scenario.last_leg)


def measured(observation, own, others=(), remaining=2.0, node=0):
    """As if the agent stood at a node and these places had been measured."""
    x, known = np.full((2, SLOTS, 2), -9.0, np.float32), np.zeros((2, SLOTS), bool)
    times = np.broadcast_to(np.arange(SLOTS, dtype=np.float32), (2, SLOTS)).reshape(-1)
    for agent, places in enumerate((own, others)):
        x[agent, : len(places)] = np.reshape(places, (-1, 2))
        known[agent, : len(places)] = True
    values = (jnp.asarray(x.reshape(-1, 2)), jnp.asarray(times), jnp.asarray(known.reshape(-1)), jnp.asarray(remaining))
    position = observation.roadmap.nodes[node]
    return eqx.tree_at(
        lambda o: (o.measurement_x, o.measurement_time, o.known, o.remaining, o.position),
        observation,
        (*values, jnp.asarray(position)),
    )


def ways(roadmap):
    """Length of the shortest way from each node to each, by SciPy."""
    rows = np.repeat(np.arange(len(roadmap.nodes)), roadmap.neighbours.shape[1])
    there = np.asarray(roadmap.reachable).ravel() & (np.asarray(roadmap.distances).ravel() > 0)
    legs = (np.asarray(roadmap.distances, float).ravel()[there], (rows[there], np.ravel(roadmap.neighbours)[there]))
    return dijkstra(csr_array(legs, shape=(len(roadmap.nodes),) * 2))


@given(node=st.integers(0, 59), rest=st.lists(st.tuples(*[st.floats(0, 1, width=32)] * 2), max_size=4))
def test_who_stays_goes_the_shortest_way_to_the_nearest_unmeasured_node(observed, node, rest):
    nodes = np.asarray(observed[AMONG].roadmap.nodes)
    observation = measured(observed[AMONG], [nodes[node]] * 3, rest, node=node)
    here, free = both(AMONG, observation)
    length = ways(observation.roadmap)
    places = np.asarray(observation.measurement_x)[np.asarray(observation.known)]
    far = np.linalg.norm(nodes[:, None] - places, axis=-1).min(axis=1) > 1.25 * INTERVAL
    reach = np.where(far & (length[node] <= 2.0), length[node], np.inf)
    apart = np.asarray(free.allowed & (free.lengths > 0.1 * INTERVAL))
    if not np.isfinite(reach).any():
        np.testing.assert_array_equal(here.allowed, apart)
        return
    assert int(here.allowed.sum()) == 1
    edge = int(jnp.argmax(here.allowed))
    assert free.allowed[edge]
    by = float(here.lengths[edge]) + length[int(here.target_nodes[edge])][far]
    best = np.where(
        apart, np.asarray(free.lengths) + length[np.asarray(free.target_nodes)][:, np.argmin(reach)], np.inf
    )
    assert by.min() <= best.min() + 1e-5


@pytest.mark.parametrize("own", [[], [0], [0, 0], [0, 0, 0, 1]], ids=str)
def test_who_does_not_stay_is_free(observed, own):
    """Two measurements around the last one are none too many, nor are three at another place."""
    nodes = np.asarray(observed[AMONG].roadmap.nodes)
    away = nodes[np.argmax(np.linalg.norm(nodes - nodes[0], axis=1))]
    here, free = both(AMONG, measured(observed[AMONG], [away if i else nodes[0] for i in own]))
    apart = np.asarray(free.allowed & (free.lengths > 0.1 * INTERVAL))
    np.testing.assert_array_equal(here.allowed, apart)


def test_the_others_measurements_hold_nobody_up(observed):
    start = observed[AMONG].roadmap.nodes[0]
    here, _ = both(AMONG, measured(observed[AMONG], [start], [start] * 5))
    assert int(here.allowed.sum()) > 1


def test_who_stays_on_open_water_is_free(observed):
    observation = measured(observed[OPEN], [observed[OPEN].roadmap.nodes[0]] * 4)
    here, free = both(OPEN, observation)
    jax.tree.map(np.testing.assert_array_equal, here, free)


def test_nobody_sets_out_for_what_the_budget_does_not_reach(observed):
    start = observed[AMONG].roadmap.nodes[0]
    here, free = both(AMONG, measured(observed[AMONG], [start] * 3, remaining=0.1))
    assert int(here.allowed.sum()) == int((free.allowed & (free.lengths > 0.1 * INTERVAL)).sum()) > 1
