"""Roadmaps: against reference vectors, brute force, and independent geometry."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import LineString, Polygon

from maipp.errors import InputError
from maipp.roadmap import (
    Obstacles,
    Roadmap,
    build_roadmap,
    sample_roadmaps,
)

SQUARE = [(0.3, 0.3), (0.7, 0.3), (0.7, 0.7), (0.3, 0.7)]
TRIANGLE = [(0.05, 0.8), (0.25, 0.75), (0.15, 0.95)]
WALL = [(0.45, -0.1), (0.55, -0.1), (0.55, 1.1), (0.45, 1.1)]
SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def vectors():
    with np.load(Path(__file__).parents[1] / "data" / "roadmap_vectors.npz") as file:
        return dict(file)


def _one_roadmap(rng: np.random.Generator, start, **options) -> Roadmap:
    """The roadmap of a single start."""
    return jax.tree.map(lambda a: a[0], sample_roadmaps(rng, np.array([start]), **options))


def _shortest_distances(roadmap: Roadmap, directed: bool = True) -> np.ndarray:
    """Length of the shortest path along reachable edges from each node to each node; inf where there is none."""
    kept, count = np.asarray(roadmap.reachable), len(roadmap.nodes)
    # Built from these three arrays, the graph keeps its zero-length edges (between coincident nodes).
    offsets = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    edges = (np.asarray(roadmap.distances)[kept], np.asarray(roadmap.neighbours)[kept], offsets)
    return dijkstra(csr_array(edges, shape=(count, count)), directed=directed)


def _floyd_warshall(roadmap: Roadmap, directed: bool) -> np.ndarray:
    count = roadmap.nodes.shape[0]
    length = np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    for i in range(count):
        for j, d, kept in zip(roadmap.neighbours[i], roadmap.distances[i], roadmap.reachable[i], strict=True):
            if kept:
                length[i, j] = min(length[i, j], d)
                if not directed:
                    length[j, i] = min(length[j, i], d)
    for via in range(count):
        length = np.minimum(length, length[:, via, None] + length[via])
    return length


@pytest.mark.parametrize("graph", [0, 1])
def test_neighbours_match_reference(vectors, graph):
    roadmap = build_roadmap(vectors[f"prm{graph}_nodes"], 20)
    np.testing.assert_array_equal(roadmap.neighbours, vectors[f"prm{graph}_knn_idx"][:, 1:])
    np.testing.assert_allclose(roadmap.distances, vectors[f"prm{graph}_knn_dist"][:, 1:], rtol=0, atol=1e-12)
    assert roadmap.neighbours.dtype == np.int32
    assert roadmap.reachable.all()


@pytest.mark.parametrize("graph", [0, 1])
@pytest.mark.parametrize("kind", ["directed", "undirected"])
def test_shortest_distances_match_reference(vectors, graph, kind):
    roadmap = build_roadmap(vectors[f"prm{graph}_nodes"], 20)
    distances = _shortest_distances(roadmap, directed=kind == "directed")
    expected = vectors[f"prm{graph}_dij_{kind}_k20"]
    np.testing.assert_allclose(distances[vectors["rows"]], expected, rtol=0, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(SEEDS, st.integers(2, 30), st.data())
def test_neighbours_are_the_nearest_others(seed, count, data):
    width = data.draw(st.integers(1, count - 1))
    # Coordinates on a coarse lattice, so that ties and coincident nodes are common.
    nodes = np.random.default_rng(seed).integers(0, 4, (count, 2)) / 4
    roadmap = build_roadmap(nodes, width)
    assert not (roadmap.neighbours == np.arange(count)[:, None]).any()
    assert all(len(set(row)) == width for row in roadmap.neighbours.tolist())
    gap = np.linalg.norm(nodes[:, None] - nodes, axis=-1)
    np.testing.assert_allclose(roadmap.distances, gap[np.arange(count)[:, None], roadmap.neighbours], atol=1e-15)
    np.fill_diagonal(gap, np.inf)
    np.testing.assert_allclose(roadmap.distances, np.sort(gap, axis=1)[:, :width], atol=1e-15)


@settings(deadline=None, max_examples=30)
@given(SEEDS)
def test_kept_edges_never_enter_an_obstacle_and_are_the_nearest_in_sight(seed):
    obstacles = [SQUARE, TRIANGLE]
    nodes = _one_roadmap(np.random.default_rng(seed), (0.0, 0.0), nodes=40, neighbours=6, obstacles=obstacles).nodes
    roadmap = build_roadmap(nodes, 6, obstacles)
    polygons = [Polygon(SQUARE), Polygon(TRIANGLE)]
    for i, node in enumerate(roadmap.nodes):
        legs = [LineString([node, other]) for other in roadmap.nodes]
        visible = [
            not any(leg.intersection(p).length > 1e-12 for p in polygons) and j != i for j, leg in enumerate(legs)
        ]
        nearest = sorted((leg.length, j) for j, leg in enumerate(legs) if visible[j])[:6]
        kept = roadmap.reachable[i]
        assert roadmap.neighbours[i][kept].tolist() == [j for _, j in nearest]
        assert kept.sum() == len(nearest)
        assert kept.tolist() == sorted(kept.tolist(), reverse=True)


def test_rows_keep_their_width_where_too_few_nodes_are_in_sight():
    nodes = np.array([[0.1, 0.5], [0.2, 0.5], [0.8, 0.5], [0.85, 0.5], [0.9, 0.5]])
    roadmap = build_roadmap(nodes, 3, [WALL])
    assert roadmap.neighbours[0].tolist() == [1, 2, 3]
    assert roadmap.reachable[0].tolist() == [True, False, False]
    assert roadmap.reachable[4].tolist() == [True, True, False]
    assert np.isinf(_shortest_distances(roadmap)[0, 2])
    assert np.isfinite(_shortest_distances(roadmap)[2:, 2:]).all()


def test_a_node_beside_an_obstacle_looks_past_the_hidden_ones():
    hidden = np.stack([np.full(30, 0.56), np.linspace(0.45, 0.55, 30)], axis=1)
    nodes = np.concatenate([[[0.44, 0.5], [0.1, 0.4], [0.1, 0.6]], hidden])
    roadmap = build_roadmap(nodes, 2, [WALL])
    assert set(roadmap.neighbours[0].tolist()) == {1, 2}
    assert roadmap.reachable.all()


def test_neighbours_are_directed():
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [1.1, 0.0], [1.3, 0.0]])
    roadmap = build_roadmap(nodes, 1)
    assert roadmap.neighbours.ravel().tolist() == [1, 2, 1, 2]
    assert np.isinf(_shortest_distances(roadmap)[1, 0])
    assert _shortest_distances(roadmap, directed=False)[1, 0] == 1.0


@pytest.mark.parametrize("directed", [True, False])
@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_shortest_distances_are_a_metric_and_agree_with_floyd_warshall(directed, seed):
    # Lattice nodes coincide now and then: their edges of length zero must count as edges.
    nodes = np.random.default_rng(seed).integers(0, 4, (20, 2)) / 4
    roadmap = build_roadmap(nodes, 4, [[(0.3, 0.3), (0.45, 0.3), (0.45, 0.7)]])
    distances = _shortest_distances(roadmap, directed=directed)
    np.testing.assert_allclose(distances, _floyd_warshall(roadmap, directed), rtol=0, atol=1e-12)
    assert (np.diag(distances) == 0).all()
    assert (distances[:, None, :] <= distances[:, :, None] + distances[None] + 1e-12).all()
    if not directed:
        np.testing.assert_allclose(distances, distances.T, atol=1e-12)


def test_few_nodes_are_joined_as_many_are(monkeypatch):
    nodes = np.random.default_rng(4).random((3, 90, 2))
    few = build_roadmap(nodes, 7)
    monkeypatch.setattr("maipp.roadmap.prm._FEW_NODES", 0)
    jax.tree.map(np.testing.assert_array_equal, few, build_roadmap(nodes, 7))


def test_coincident_nodes_are_joined_at_no_cost():
    nodes = np.array([[0.5, 0.5]] * 5 + [[0.6, 0.5]])
    roadmap = build_roadmap(nodes, 2)
    assert (roadmap.distances[:5] == 0).all()
    assert not (roadmap.neighbours == np.arange(6)[:, None]).any()
    assert np.isfinite(_shortest_distances(roadmap, directed=False)[5]).any()
    pair = build_roadmap(nodes[:2], 1)
    np.testing.assert_array_equal(_shortest_distances(pair), np.zeros((2, 2)))
    np.testing.assert_array_equal(_shortest_distances(pair, directed=False), np.zeros((2, 2)))


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_samples_fill_the_free_part_of_the_extent(seed):
    polygons = [SQUARE, TRIANGLE]
    roadmap = _one_roadmap(
        np.random.default_rng(seed), [1.5, 0.4], nodes=60, neighbours=5, extent=(2.0, 1.0), obstacles=polygons
    )
    assert roadmap.nodes[0].tolist() == [1.5, 0.4]
    assert ((roadmap.nodes >= 0) & (roadmap.nodes <= np.array([2, 1]))).all()
    assert Obstacles(polygons).free(np.asarray(roadmap.nodes)).all()


def test_samples_are_uniform():
    nodes = sample_roadmaps(
        np.random.default_rng(1), np.zeros((50, 2)), nodes=201, neighbours=2, extent=(2.0, 1.0)
    ).nodes[:, 1:]
    counts, _, _ = np.histogram2d(*nodes.reshape(-1, 2).T, bins=(8, 4), range=((0, 2), (0, 1)))
    expected = 10_000 / 32
    # chi-square with 31 degrees of freedom: 61.1 is its 99.9 % quantile, and the seed is fixed.
    assert ((counts - expected) ** 2 / expected).sum() < 61.1


def test_nodes_stay_on_the_start_s_side_of_a_wall():
    roadmap = _one_roadmap(np.random.default_rng(0), (0.9, 0.9), nodes=50, neighbours=5, obstacles=[WALL])
    assert (roadmap.nodes[:, 0] > 0.55).all()
    assert roadmap.reachable.all()


def test_a_start_on_an_obstacle_s_border_is_allowed():
    roadmap = _one_roadmap(np.random.default_rng(0), (0.55, 0.5), nodes=50, neighbours=5, obstacles=[WALL])
    assert (roadmap.nodes[1:, 0] > 0.55).all()
    assert roadmap.reachable.all()


@pytest.mark.parametrize("obstacles", [(), (SQUARE,)])
def test_a_batch_is_the_single_roadmaps_in_turn(obstacles):
    starts = np.array([[0.0, 0.0], [0.2, 0.9], [1.0, 1.0]])
    options = {"nodes": 30, "neighbours": 4, "obstacles": obstacles}
    batch = sample_roadmaps(np.random.default_rng(7), starts, **options)
    rng = np.random.default_rng(7)
    single = [_one_roadmap(rng, start, **options) for start in starts]
    for stacked, *fields in zip(jax.tree.leaves(batch), *map(jax.tree.leaves, single), strict=True):
        np.testing.assert_array_equal(stacked, np.stack(fields))


def test_batch_axes_are_kept_and_a_roadmap_is_a_pytree():
    nodes = np.random.default_rng(0).random((2, 3, 10, 2))
    roadmap = jax.tree.map(jnp.asarray, build_roadmap(nodes, 4))
    assert roadmap.nodes.shape == (2, 3, 10, 2)
    assert roadmap.neighbours.shape == roadmap.distances.shape == roadmap.reachable.shape == (2, 3, 10, 4)


def _sample(**changes):
    options = {"start": (0.0, 0.0), "nodes": 20, "neighbours": 3, **changes}
    start = options.pop("start")
    return _one_roadmap(np.random.default_rng(0), start, **options)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"neighbours": 20}, "neighbours is 20 for a roadmap of 20 nodes; .* nodes - 1 = 19"),
        ({"neighbours": 0}, "neighbours is 0 .* between 1 and"),
        ({"nodes": 1}, "nodes is 1; a roadmap needs at least 2"),
        ({"extent": (0.0, 1.0)}, r"extent is \(0.0, 1.0\); .*positive"),
        (
            {"start": (1.5, 0.5)},
            r"start \(1.5, 0.5\) lies outside the extent; it must lie in \[0, 1\] x \[0, 1\]",
        ),
        ({"start": (float("nan"), 0.5)}, "outside the extent"),
        ({"start": (0.5, 0.5), "obstacles": [TRIANGLE, SQUARE]}, "inside obstacle 1; move the start"),
        (
            {"obstacles": [[(0.0005, -1.0), (2.0, -1.0), (2.0, 2.0), (0.0005, 2.0)], WALL]},
            "obstacles leave only 0.05% of the extent free",
        ),
        (
            {"obstacles": [[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]]},
            "leave only 0% of the extent free",
        ),
    ],
)
def test_bad_input_is_explained(changes, message):
    with pytest.raises(InputError, match=message):
        _sample(**changes)


def test_nodes_must_be_finite():
    with pytest.raises(InputError, match="finite"):
        build_roadmap(np.array([[0.0, 0.0], [np.nan, 0.0]]), 1)
