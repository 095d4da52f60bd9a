"""Spectral positions of roadmap nodes: the eigenvectors of the graph's Laplacian.

Source: Dwivedi & Bresson 2020; Yang et al. 2023, Sec. IV-D.
"""

import math

import numpy as np
from scipy.sparse.csgraph import connected_components

from maipp.roadmap.prm import Roadmap
from maipp.typing import Float


def normalised_laplacian(roadmap: Roadmap) -> Float[np.ndarray, "*batch n n"]:
    """I - D^-1/2 A D^-1/2 of the symmetrised, unweighted roadmap, float64.

    A joins two nodes where either lists the other as a reachable neighbour. The row and column of a node
    without edges are zero, so that the eigenvalue zero has exactly one eigenvector per connected component.
    """
    neighbours, reachable = np.asarray(roadmap.neighbours), np.asarray(roadmap.reachable)
    adjacency = np.zeros((*neighbours.shape[:-1], neighbours.shape[-2]))
    np.put_along_axis(adjacency, neighbours, reachable.astype(np.float64), axis=-1)
    # The nearest-neighbour relation is not mutual. Without this step the matrix would not be symmetric, and
    # its eigenvectors neither real nor orthogonal.
    adjacency = np.maximum(adjacency, np.swapaxes(adjacency, -1, -2))
    degree = adjacency.sum(axis=-1)
    scale = np.where(degree > 0, 1 / np.sqrt(np.maximum(degree, 1)), 0.0)
    return np.eye(degree.shape[-1]) * (degree > 0)[..., None] - (scale[..., :, None] * adjacency * scale[..., None, :])


def laplacian_encoding(roadmap: Roadmap, dimensions: int = 32) -> Float[np.ndarray, "*batch n {dimensions}"]:
    """Unit eigenvectors of `normalised_laplacian` for its smallest non-zero eigenvalues, one per column.

    float32, by ascending eigenvalue. A roadmap in c connected components has c zero eigenvalues, whose
    eigenvectors only tell the components apart: all c are left out. Columns beyond the n - c that remain are
    zero. Each column's largest component is positive, the first of equally large ones; unless there are such
    ties, the sign does not depend on how the nodes are numbered.
    """
    laplacian = normalised_laplacian(roadmap)
    *batch, count, _ = laplacian.shape
    encoding = np.zeros((math.prod(batch), count, dimensions), dtype=np.float32)
    for index, matrix in enumerate(laplacian.reshape(-1, count, count)):
        # Counted, not judged by size: weakly joined parts have true eigenvalues as small as rounding errors.
        components = connected_components(matrix != 0, directed=False, return_labels=False)
        # All of them: at a few hundred nodes this is faster than LAPACK's search for the smallest 32.
        vectors = np.linalg.eigh(matrix).eigenvectors[:, components : components + dimensions]
        encoding[index, :, : vectors.shape[1]] = _fix_signs(vectors)
    return encoding.reshape(*batch, count, dimensions)


def _fix_signs(vectors: np.ndarray) -> np.ndarray:
    size = np.abs(vectors)
    # Symmetric roadmaps have components of equal size; rounding must not choose between them.
    first = np.argmax(size >= (1 - 1e-6) * size.max(axis=0), axis=0)
    return vectors * np.sign(vectors[first, np.arange(vectors.shape[1])])
