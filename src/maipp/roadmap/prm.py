"""Probabilistic roadmaps: random waypoints, each joined to its nearest others.

Source: Yang et al. 2023, Sec. IV-A and IV-E. Everything here runs on the host in float64; a `Roadmap` is a
pytree, so that the simulator can move it to the device as a whole.
"""

import math
from collections.abc import Sequence
from functools import cache

import equinox as eqx
import numpy as np
import shapely
from scipy.spatial import KDTree
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from maipp.errors import InputError
from maipp.roadmap.bridges import is_joined, joined, with_corners
from maipp.roadmap.obstacles import Obstacles, Vertices
from maipp.roadmap.zones import free_space
from maipp.typing import Array, Bool, Float, Int

AnyArray = Array | np.ndarray
ObstaclesLike = Obstacles | Sequence[Vertices]

# Below this share of the extent, rejection sampling would draw more than 1000 points for each one kept.
_LEAST_FREE_SHARE = 1e-3

# Up to so many, all pairs of nodes are sorted: with 60 a third of the time of a tree.
_FEW_NODES = 128


class Roadmap(eqx.Module):
    """The waypoint graph of one agent, or of a batch (leading axes: missions, agents).

    Edges are directed: row i lists the k nodes nearest to node i, which need not list i in return. Where
    obstacles leave fewer than k nodes in sight, the row ends with the nearest hidden ones, `reachable` False.
    """

    nodes: Float[AnyArray, "*batch n 2"]  # positions, domain units; node 0 is the start
    neighbours: Int[AnyArray, "*batch n k"]  # int32, never the node itself; reachable ones first, by distance
    distances: Float[AnyArray, "*batch n k"]  # length of the edge to each neighbour, domain units
    reachable: Bool[AnyArray, "*batch n k"]  # False where an obstacle blocks the edge
    # `laplacian_encoding`, which costs an eigenproblem per roadmap; None where the planner needs none
    encoding: Float[AnyArray, "*batch n e"] | None = None


def build_roadmap(nodes: Float[AnyArray, "*batch n 2"], neighbours: int, obstacles: ObstaclesLike = ()) -> Roadmap:
    """The roadmap that joins each given node to its `neighbours` nearest others in sight.

    `nodes[..., 0, :]` is the start. Raises InputError for nodes that are not finite and for `neighbours`
    outside 1 .. n - 1.
    """
    points = np.asarray(nodes, dtype=np.float64)
    count = points.shape[-2]
    if not np.isfinite(points).all():
        raise InputError("roadmap nodes: every coordinate must be finite")
    if not 1 <= neighbours < count:
        raise InputError(
            f"neighbours is {neighbours} for a roadmap of {count} nodes; "
            f"it must be between 1 and nodes - 1 = {count - 1}"
        )
    obstacles = _obstacles(obstacles)
    flat = points.reshape(-1, count, 2)
    order = np.empty((len(flat), count, neighbours), dtype=np.int32)
    distances = np.empty(order.shape)
    reachable = np.ones(order.shape, dtype=bool)
    if not len(obstacles) and count <= _FEW_NODES:
        order[:], distances[:] = _nearest_of_few(flat, neighbours)
    else:
        for row, positions in enumerate(flat):
            if len(obstacles):
                order[row], distances[row], reachable[row] = _nearest_in_sight(positions, neighbours, obstacles)
            else:
                order[row], distances[row] = _nearest(KDTree(positions), np.arange(count), neighbours)
    shape = (*points.shape[:-1], neighbours)
    return Roadmap(points, order.reshape(shape), distances.reshape(shape), reachable.reshape(shape))


def sample_roadmaps(
    rng: np.random.Generator,
    starts: Float[AnyArray, "b 2"],
    *,
    nodes: int,
    neighbours: int,
    extent: Sequence[float] = (1.0, 1.0),
    obstacles: ObstaclesLike = (),
) -> Roadmap:
    """One roadmap per start, stacked along axis b: the start and `nodes - 1` uniform random points of the extent.

    The extent is [0, width] x [0, height].
    With obstacles the points are uniform over the free region that can be reached from the start; where that leaves
    nodes that cannot be reached from each other, `bridges` joins them. Raises InputError for a start outside the extent
    or inside an obstacle, for obstacles that leave next to nothing free, and as `build_roadmap`.
    """
    starts = np.asarray(starts, dtype=np.float64)
    size = np.asarray(extent, dtype=np.float64)
    if size.shape != (2,) or not (np.isfinite(size) & (size > 0)).all():
        raise InputError(f"extent is {tuple(extent)}; it must be (width, height), both finite and positive")
    if nodes < 2:
        raise InputError(f"nodes is {nodes}; a roadmap needs at least 2, the start and one other")
    obstacles = _obstacles(obstacles)
    check_starts(starts, size, obstacles)
    points = np.empty((len(starts), nodes, 2))
    points[:, 0] = starts
    if len(obstacles):
        for row, start in enumerate(starts):
            region = _reachable_region(start, size, obstacles)
            points[row, 1:] = _sample_region(rng, nodes - 1, size, region)
        return _without_traps(build_roadmap(points, neighbours, obstacles), extent, obstacles)
    points[:, 1:] = rng.random((len(starts), nodes - 1, 2)) * size
    return build_roadmap(points, neighbours, obstacles)


def _obstacles(obstacles: ObstaclesLike) -> Obstacles:
    if isinstance(obstacles, Obstacles):
        return obstacles
    return Obstacles(obstacles) if len(obstacles) else _nothing_there()


@cache
def _nothing_there() -> Obstacles:
    """No obstacles, whose geometry takes as long to make as a roadmap."""
    return Obstacles()


def _nearest_of_few(maps: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The `count` nearest others of every node of its map (b, n, 2), and their distances, each (b, n, count).

    All pairs: sorting a few is quicker than searching a tree of them.
    """
    x, y = maps[..., 0], maps[..., 1]
    across, along = x[:, :, None] - x[:, None], y[:, :, None] - y[:, None]
    squared = across * across + along * along
    squared[:, *np.diag_indices(maps.shape[1])] = np.inf
    order = np.argsort(squared, axis=-1)[..., :count]
    return order, np.sqrt(np.take_along_axis(squared, order, axis=-1))


def _nearest(tree: KDTree, rows: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The `count` nearest others of the nodes `rows` and their distances, ascending, each (rows, count)."""
    distances, order = map(np.asarray, tree.query(tree.data[rows], k=count + 1))
    is_self = order == rows[:, None]
    # Among more coincident nodes than asked for, a node may miss itself: then the last is the one too many.
    is_self[~is_self.any(axis=1), -1] = True
    return order[~is_self].reshape(-1, count), distances[~is_self].reshape(-1, count)


def _nearest_in_sight(nodes: np.ndarray, count: int, obstacles: Obstacles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The `count` nearest others in sight, their distances, False where hidden ones fill up: (n, count)."""
    tree = KDTree(nodes)
    order = np.empty((len(nodes), count), dtype=np.int32)
    distances = np.empty(order.shape)
    reachable = np.empty(order.shape, dtype=bool)
    rows, candidates = np.arange(len(nodes)), count
    while rows.size:
        # Rows whose candidates do not suffice are asked again with twice as many, at last with all nodes.
        candidates = min(2 * candidates, len(nodes) - 1)
        others, lengths = _nearest(tree, rows, candidates)
        hidden = obstacles.crosses(np.repeat(nodes[rows], candidates, axis=0), nodes[others].reshape(-1, 2))
        hidden = hidden.reshape(others.shape)
        chosen = np.argsort(hidden, axis=1, kind="stable")[:, :count]
        order[rows] = np.take_along_axis(others, chosen, axis=1)
        distances[rows] = np.take_along_axis(lengths, chosen, axis=1)
        reachable[rows] = ~np.take_along_axis(hidden, chosen, axis=1)
        if candidates == len(nodes) - 1:
            break
        rows = rows[~reachable[rows, -1]]
    return order, distances, reachable


def _without_traps(roadmap: Roadmap, extent: Sequence[float], obstacles: Obstacles) -> Roadmap:
    """The roadmaps (b, n, ...), those changed where not all nodes can be reached from each other (`bridges`)."""
    points, *edges = (np.array(a) for a in (roadmap.nodes, roadmap.neighbours, roadmap.distances, roadmap.reachable))
    polygons = tuple(tuple(map(tuple, polygon.exterior.coords[:-1])) for polygon in obstacles.polygons)
    for row, (order, distances, reachable) in enumerate(zip(*edges, strict=True)):
        if is_joined(order, reachable):
            continue
        corners = free_space(polygons, (float(extent[0]), float(extent[1]))).corners
        moved = with_corners(points[row], corners, obstacles)
        if (moved != points[row]).any():
            points[row] = moved
            order, distances, reachable = _nearest_in_sight(moved, order.shape[1], obstacles)
        for array, new in zip(edges, joined(moved, order, distances, reachable, obstacles), strict=True):
            array[row] = new
    return Roadmap(points, *edges)


def check_starts(starts: Float[np.ndarray, "b 2"], size: Float[np.ndarray, "2"], obstacles: Obstacles) -> None:
    """Raise InputError for a start outside [0, width] x [0, height] = `size`, or inside an obstacle."""
    outside = ~((starts >= 0) & (starts <= size)).all(axis=1)
    if outside.any():
        raise InputError(
            f"start {_text(starts[outside][0])} lies outside the extent; "
            f"it must lie in [0, {size[0]:g}] x [0, {size[1]:g}]"
        )
    if not len(obstacles):
        return
    inside = ~obstacles.free(starts)
    if inside.any():
        start = starts[inside][0]
        # On a side shared by two obstacles a point is inside neither, only inside their union.
        point = Point(start)
        index = int(np.argmin([p.distance(point) - p.contains(point) for p in obstacles.polygons]))
        raise InputError(f"start {_text(start)} lies inside obstacle {index}; move the start or the obstacle")


def _reachable_region(start: np.ndarray, size: np.ndarray, obstacles: Obstacles) -> BaseGeometry:
    """The part of the free extent that is joined to the start; nodes elsewhere could never be visited."""
    free = shapely.difference(shapely.box(0.0, 0.0, *size), obstacles.union)
    parts = shapely.get_parts(free)
    # A start on a border may sit one rounding error outside the part it belongs to.
    region = shapely.union_all(parts[shapely.distance(parts, Point(start)) <= 1e-9 * size.max()])
    share = region.area / size.prod()
    if share < _LEAST_FREE_SHARE:
        raise InputError(
            f"obstacles leave only {100 * share:.2g}% of the extent free to an agent that starts at "
            f"{_text(start)}; at least {100 * _LEAST_FREE_SHARE:g}% is needed: "
            "move the start or shrink the obstacles"
        )
    return region


def _sample_region(rng: np.random.Generator, count: int, size: np.ndarray, region: BaseGeometry) -> np.ndarray:
    """`count` uniform points of the region's interior, (count, 2), by rejection."""
    shapely.prepare(region)
    share = region.area / size.prod()
    kept = np.empty((0, 2))
    while len(kept) < count:
        drawn = rng.random((math.ceil(1.2 * count / share) + 8, 2)) * size
        kept = np.concatenate([kept, drawn[shapely.contains_xy(region, drawn[:, 0], drawn[:, 1])]])
    return kept[:count]


def _text(point: np.ndarray) -> str:
    return f"({point[0]:g}, {point[1]:g})"
