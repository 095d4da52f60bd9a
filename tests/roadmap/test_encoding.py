"""The Laplacian encoding: eigenvectors of the right matrix, in order, with a stable sign."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.roadmap import build_roadmap, laplacian_encoding, normalised_laplacian, sample_roadmaps

WALL = [(0.45, -0.1), (0.55, -0.1), (0.55, 1.1), (0.45, 1.1)]
SEEDS = st.integers(0, 2**32 - 1)


def _laplacian(roadmap) -> np.ndarray:
    """The same matrix, entry by entry from its definition."""
    count = roadmap.nodes.shape[0]
    joined = [set() for _ in range(count)]
    for i in range(count):
        for j in roadmap.neighbours[i][roadmap.reachable[i]].tolist():
            joined[i].add(j)
            joined[j].add(i)
    matrix = np.zeros((count, count))
    for i in range(count):
        matrix[i, i] = float(bool(joined[i]))
        for j in joined[i]:
            matrix[i, j] = -1 / np.sqrt(len(joined[i]) * len(joined[j]))
    return matrix


@settings(deadline=None, max_examples=15)
@given(SEEDS)
def test_columns_are_the_first_eigenvectors_in_order(seed):
    roadmap = build_roadmap(np.random.default_rng(seed).random((60, 2)), 8)
    laplacian = _laplacian(roadmap)
    np.testing.assert_allclose(normalised_laplacian(roadmap), laplacian, atol=1e-14)
    encoding = laplacian_encoding(roadmap)
    assert encoding.shape == (60, 32)
    assert encoding.dtype == np.float32
    np.testing.assert_allclose(encoding.T @ encoding, np.eye(32), atol=1e-5)
    spectrum = np.linalg.eigvalsh(laplacian)
    zeros = int((spectrum < 1e-9).sum())
    np.testing.assert_allclose(laplacian @ encoding, encoding * spectrum[zeros : zeros + 32], atol=1e-5)


@settings(deadline=None, max_examples=15)
@given(SEEDS)
def test_numbering_of_the_nodes_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    nodes, order = rng.random((50, 2)), rng.permutation(50)
    roadmap = build_roadmap(nodes, 8)
    spectrum = np.linalg.eigvalsh(_laplacian(roadmap))
    zeros = int((spectrum < 1e-9).sum())
    gap = np.diff(spectrum)
    encoding = laplacian_encoding(roadmap, 10).astype(np.float64)
    renumbered = laplacian_encoding(build_roadmap(nodes[order], 8), 10).astype(np.float64)
    for column in range(10):
        if min(gap[zeros + column - 1], gap[zeros + column]) > 1e-6:
            overlap = abs(encoding[order, column] @ renumbered[:, column])
            assert overlap == pytest.approx(1, abs=1e-5)


def test_the_largest_component_is_positive():
    encoding = laplacian_encoding(build_roadmap(np.random.default_rng(3).random((80, 2)), 10))
    assert (encoding.max(axis=0) == np.abs(encoding).max(axis=0)).all()


def test_of_equally_large_components_the_first_is_positive():
    # The path 0 - 1 - 2: its second eigenvector is (1, 0, -1) / sqrt(2), its third (1, -sqrt 2, 1) / 2.
    encoding = laplacian_encoding(build_roadmap(np.array([[0.0, 0.0], [1.0, 0.0], [2.1, 0.0]]), 1), 3)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(encoding, [[half, -0.5, 0], [0, half, 0], [-half, -0.5, 0]], atol=1e-6)


def test_a_small_roadmap_is_padded_with_zeros():
    encoding = laplacian_encoding(build_roadmap(np.random.default_rng(0).random((10, 2)), 5))
    assert encoding.shape == (10, 32)
    np.testing.assert_allclose(np.linalg.norm(encoding, axis=0), [1] * 9 + [0] * 23, atol=1e-6)


def test_every_component_s_zero_eigenvalue_is_left_out():
    rng = np.random.default_rng(5)
    left, right = rng.random((20, 2)) * [0.4, 1], rng.random((20, 2)) * [0.4, 1] + [0.6, 0]
    roadmap = build_roadmap(np.concatenate([left, right]), 8, [WALL])
    encoding = laplacian_encoding(roadmap, 39)
    np.testing.assert_allclose(np.linalg.norm(encoding, axis=0), [1] * 38 + [0], atol=1e-6)
    quotient = np.einsum("nd,nm,md->d", encoding, _laplacian(roadmap), encoding)[:38]
    assert quotient.min() > 1e-3
    assert (np.diff(quotient) > -1e-6).all()


def test_a_node_without_edges_is_encoded_as_zero():
    nodes = np.concatenate([[[0.1, 0.5]], np.random.default_rng(1).random((20, 2)) * [0.4, 1] + [0.6, 0]])
    encoding = laplacian_encoding(build_roadmap(nodes, 5, [WALL]), 32)
    assert (encoding[0] == 0).all()
    np.testing.assert_allclose(np.linalg.norm(encoding, axis=0), [1] * 19 + [0] * 13, atol=1e-6)


def test_a_batch_is_encoded_one_by_one():
    batch = sample_roadmaps(np.random.default_rng(0), np.zeros((3, 2)), nodes=40, neighbours=6)
    expected = [laplacian_encoding(build_roadmap(nodes, 6), 8) for nodes in batch.nodes]
    np.testing.assert_array_equal(laplacian_encoding(batch, 8), np.stack(expected))
