"""Where an agent stands on its roadmap and which edges its budget allows: against SciPy and by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from maipp.roadmap import Roadmap, build_roadmap, edges_from, nearest_node, sample_roadmaps

ROADMAPS = sample_roadmaps(np.random.default_rng(0), np.array([[0.2, 0.7]]), nodes=30, neighbours=4)
NODES = jax.tree.map(lambda a: a[0], ROADMAPS)
nearest, leaving = jax.jit(nearest_node), jax.jit(edges_from, static_argnames="last_leg")


@given(place=st.tuples(*[st.floats(-0.5, 1.5, width=32)] * 2))
def test_the_nearest_node_is_that_of_a_tree(place):
    near = int(nearest(NODES, jnp.asarray(place)))
    distance = KDTree(NODES.nodes).query(place)[0]
    assert np.linalg.norm(np.asarray(NODES.nodes)[near] - place) == pytest.approx(distance, abs=1e-5)


@given(node=st.integers(0, 29), remaining=st.floats(0, 1, width=32), last_leg=st.sampled_from(["stop", "cut"]))
def test_edges_are_those_that_the_budget_allows(node, remaining, last_leg):
    here = leaving(NODES, jnp.int32(node), jnp.float32(remaining), last_leg=last_leg)
    lengths = np.linalg.norm(np.asarray(here.targets) - np.asarray(NODES.nodes)[node], axis=1)
    np.testing.assert_allclose(here.lengths, lengths, atol=1e-6)
    np.testing.assert_array_equal(here.target_nodes, np.asarray(NODES.neighbours)[node])
    affordable = lengths <= remaining if last_leg == "stop" else np.full(4, remaining > 0)
    sure = abs(lengths - remaining) > 1e-4 if last_leg == "stop" else np.full(4, remaining == 0 or remaining > 1e-4)
    np.testing.assert_array_equal(np.asarray(here.allowed)[sure], affordable[sure])


@pytest.mark.parametrize("last_leg", ["stop", "cut"])
def test_nobody_goes_through_a_zone_nor_to_where_it_is(last_leg):
    row = build_roadmap(np.array([[0.0, 0.0], [0.0, 0.0], [0.5, 0.0], [0.9, 0.0]]), 3)
    roadmap = Roadmap(row.nodes, row.neighbours, row.distances, np.array([[True, True, False]] * 4))
    here = leaving(roadmap, jnp.int32(0), jnp.float32(1.0), last_leg=last_leg)
    assert here.target_nodes.tolist() == [1, 2, 3] and here.allowed.tolist() == [False, True, False]
