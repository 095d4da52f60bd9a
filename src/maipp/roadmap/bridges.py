"""Edges and nodes that join the parts of a roadmap among no-go zones, so that no agent is shut in.

Each node is joined to its nearest others in sight. In a bay, or before a narrow passage, all of these may be on the
same side, and since edges are directed an agent may get in and never out again. Then the shortest edges that join the
parts, both ways, take the place of the longest ones there; where no two nodes see each other through a passage,
corners of the zones take the place of nodes that stand close together.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from maipp.roadmap.obstacles import Obstacles
from maipp.typing import Bool, Float, Int

# Rounds until all is joined; one does nearly always, as a new edge rarely takes the place of one that is needed.
_ROUNDS = 10


def is_joined(order: Int[np.ndarray, "n k"], reachable: Bool[np.ndarray, "n k"]) -> bool:
    """Whether every node can be reached from every other along reachable edges."""
    return _parts(order, reachable)[0] == 1


def with_corners(
    nodes: Float[np.ndarray, "n 2"], corners: Float[np.ndarray, "v 2"], obstacles: Obstacles
) -> Float[np.ndarray, "n 2"]:
    """The nodes, some replaced by corners so that all can be reached from the first by edges that keep out of zones.

    The same where that is so already, or where no way over the corners exists.
    """
    nodes = nodes.copy()
    kept = np.zeros(len(nodes), bool)
    kept[0] = True
    for _ in range(_ROUNDS):
        every = np.concatenate([nodes, corners])
        lengths = np.maximum(_in_sight(every, obstacles), 1e-12)  # an edge of length zero would be none
        count, label = connected_components(lengths[: len(nodes), : len(nodes)], directed=False)
        if count == 1:
            break
        home = np.flatnonzero(label == label[0])
        distance, before, _ = dijkstra(lengths, directed=False, indices=home, min_only=True, return_predecessors=True)
        away = np.flatnonzero(label != label[0])
        nearest = away[np.argmin(distance[away])]
        if not np.isfinite(distance[nearest]):
            break
        turns = []
        node = before[nearest]
        while node >= len(nodes):
            turns.append(every[node])
            node = before[node]
        for turn in turns:
            given_up = _crowded(nodes, kept)
            if given_up is None:
                return nodes
            nodes[given_up], kept[given_up] = turn, True
    return nodes


def joined(
    nodes: Float[np.ndarray, "n 2"],
    order: Int[np.ndarray, "n k"],
    distances: Float[np.ndarray, "n k"],
    reachable: Bool[np.ndarray, "n k"],
    obstacles: Obstacles,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbours, distances and which are reachable, with edges added until all that is joined by sight is by edges."""
    order, distances, reachable = order.copy(), distances.copy(), reachable.copy()
    lengths = _in_sight(nodes, obstacles)
    start, end = np.triu_indices(len(nodes), 1)
    seen = np.isfinite(lengths[start, end]) & (lengths[start, end] > 0)
    start, end = start[seen], end[seen]
    shortest = np.argsort(lengths[start, end], kind="stable")
    pairs = list(zip(start[shortest].tolist(), end[shortest].tolist(), strict=True))
    added = np.zeros(order.shape, bool)
    for _ in range(_ROUNDS):
        count, label = _parts(order, reachable)
        if count == 1:
            break
        for i, j in pairs:
            if label[i] != label[j]:
                _add(i, j, lengths, order, distances, reachable, added)
                _add(j, i, lengths, order, distances, reachable, added)
                label[label == label[j]] = label[i]
    rows = np.arange(len(nodes))[:, None]
    by_length = np.lexsort((distances, ~reachable), axis=1)
    return order[rows, by_length], distances[rows, by_length], reachable[rows, by_length]


def _add(
    i: int,
    j: int,
    lengths: np.ndarray,
    order: np.ndarray,
    distances: np.ndarray,
    reachable: np.ndarray,
    added: np.ndarray,
) -> None:
    """Join node i to node j, in place of a hidden neighbour or else of the farthest."""
    if (reachable[i] & (order[i] == j)).any():
        return
    slot = int(np.argmax(np.where(added[i], -1.0, np.where(reachable[i], distances[i], np.inf))))
    order[i, slot], distances[i, slot], reachable[i, slot], added[i, slot] = j, lengths[i, j], True, True


def _crowded(nodes: np.ndarray, kept: np.ndarray) -> int | None:
    """The node with the nearest neighbour, of those that are not to be kept."""
    offset = np.linalg.norm(nodes[:, None] - nodes, axis=-1)
    np.fill_diagonal(offset, np.inf)
    nearest = np.where(kept, np.inf, offset.min(axis=1))
    return int(np.argmin(nearest)) if np.isfinite(nearest).any() else None


def _parts(order: np.ndarray, reachable: np.ndarray) -> tuple[int, np.ndarray]:
    """Number of strongly connected parts, and the part of each node."""
    row = np.repeat(np.arange(len(order)), reachable.sum(axis=1))
    ones = np.ones(len(row))
    graph = csr_array((ones, (row, order[reachable])), shape=(len(order), len(order)))
    return connected_components(graph, directed=True, connection="strong")


def _in_sight(points: np.ndarray, obstacles: Obstacles) -> np.ndarray:
    """Distances between all points (n, n); inf where a zone is between two."""
    i, j = np.triu_indices(len(points), 1)
    lengths = np.full((len(points), len(points)), np.inf)
    free = ~obstacles.crosses(points[i], points[j])
    lengths[i[free], j[free]] = lengths[j[free], i[free]] = np.linalg.norm(points[i] - points[j], axis=1)[free]
    return lengths
