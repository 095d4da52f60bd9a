"""Roadmaps among no-go zones: every node can be reached from every other."""

import jax
import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from maipp.roadmap import Obstacles, build_roadmap, sample_roadmaps
from maipp.roadmap.bridges import is_joined, joined, with_corners
from tests.shared.random_areas import random_area

NODES, NEIGHBOURS = 60, 8


def strong_parts(roadmap):
    order, reachable = np.asarray(roadmap.neighbours), np.asarray(roadmap.reachable)
    row = np.repeat(np.arange(len(order)), reachable.sum(axis=1))
    graph = csr_array((np.ones(len(row)), (row, order[reachable])), shape=(len(order), len(order)))
    return connected_components(graph, directed=True, connection="strong")[0]


@pytest.mark.parametrize("seed", range(40))
def test_no_node_of_a_random_area_is_a_trap(seed):
    scenario = random_area(seed).scenario
    obstacles = Obstacles(scenario.obstacles)
    start = np.asarray(scenario.start)
    roadmaps = sample_roadmaps(
        np.random.default_rng(seed), start[None], nodes=NODES, neighbours=NEIGHBOURS, obstacles=obstacles
    )
    roadmap = jax.tree.map(lambda a: a[0], roadmaps)
    assert strong_parts(roadmap) == 1
    nodes, order, reachable = (np.asarray(a) for a in (roadmap.nodes, roadmap.neighbours, roadmap.reachable))
    np.testing.assert_array_equal(nodes[0], start)
    assert obstacles.free(nodes).all()
    begin, end = np.repeat(nodes, NEIGHBOURS, axis=0), nodes[order].reshape(-1, 2)
    np.testing.assert_allclose(np.asarray(roadmap.distances).ravel(), np.linalg.norm(end - begin, axis=1), atol=1e-12)
    kept = reachable.ravel()
    # Which way a leg is tested may differ where it just touches a corner.
    assert not (obstacles.crosses(begin[kept], end[kept]) & obstacles.crosses(end[kept], begin[kept])).any()
    assert (order != np.arange(NODES)[:, None]).all()
    assert (np.diff(reachable.astype(int), axis=1) <= 0).all()  # those in sight come first
    lengths = np.where(reachable, roadmap.distances, np.inf)
    assert (np.diff(np.nan_to_num(lengths, posinf=9.0), axis=1) >= 0).all()


def test_two_clusters_are_joined_both_ways_by_the_shortest_edge():
    rng = np.random.default_rng(0)
    nodes = np.concatenate([rng.random((6, 2)) * 0.1, rng.random((6, 2)) * 0.1 + 0.5])
    obstacles = Obstacles([[(0.9, 0.9), (0.95, 0.9), (0.9, 0.95)]])
    apart = build_roadmap(nodes, 3, obstacles)
    before, lengths, seen = (np.asarray(a) for a in (apart.neighbours, apart.distances, apart.reachable))
    assert not is_joined(before, seen)
    order, distances, reachable = joined(nodes, before, lengths, seen, obstacles)
    assert is_joined(order, reachable)
    between = np.linalg.norm(nodes[:6, None] - nodes[6:], axis=-1)
    i, j = np.unravel_index(np.argmin(between), between.shape)
    assert (order[i] == j + 6).any() and (order[j + 6] == i).any()
    changed = (order != before).any(axis=1)
    assert changed.sum() == 2
    assert distances.max() == pytest.approx(between.min())


def test_corners_lead_through_a_passage_that_no_node_sees_through():
    # An S-shaped passage between two rooms.
    walls = [
        [(0.4, 0.0), (0.45, 0.0), (0.45, 0.9), (0.4, 0.9)],
        [(0.55, 0.1), (0.6, 0.1), (0.6, 1.0), (0.55, 1.0)],
    ]
    obstacles = Obstacles(walls)
    rng = np.random.default_rng(1)
    nodes = np.concatenate([rng.random((10, 2)) * (0.3, 0.3), rng.random((10, 2)) * (0.3, 0.3) + 0.7])
    corners = np.array([[0.39, 0.95], [0.46, 0.95], [0.54, 0.05], [0.61, 0.05]])
    moved = with_corners(nodes, corners, obstacles)
    np.testing.assert_array_equal(moved[0], nodes[0])
    changed = (moved != nodes).any(axis=1)
    assert 1 <= changed.sum() <= 4 and all((corner == corners).all(axis=1).any() for corner in moved[changed])
    everyone = build_roadmap(moved, len(moved) - 1, obstacles)
    assert is_joined(np.asarray(everyone.neighbours), np.asarray(everyone.reachable))
    np.testing.assert_array_equal(with_corners(moved, corners, obstacles), moved)
    assert (with_corners(nodes, corners[:0], obstacles) == nodes).all()
