"""A random tree in the plane, and the way that is better than any of its paths among no-go zones."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.flatten_util import ravel_pytree

from maipp.engine.polyline import along_paths, first_part
from maipp.planners.plane.transit import best_transit
from maipp.roadmap.collision import collision_free_share
from maipp.roadmap.shortest_paths import longest_free_leg
from maipp.roadmap.zones import Zones
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Extent, Float, Int, Key, Point, Real

# Samples that each node of the tree has where there are no-go zones, until one gives a free edge.
_TRIES = 8


class Tree(NamedTuple):
    """A rapidly-exploring random tree; every node carries what its path from the root passes."""

    position: Float[Array, "n 2"]  # node positions, domain units
    length: Float[Array, " n"]  # path length from the root
    depth: Int[Array, " n"]  # edges from the root
    vertices: Float[Array, "n w 2"]  # the first w vertices of its path
    marks: Float[Array, "n h 2"]  # where its path measures; valid up to its length


def grow_tree(
    key: Key,
    root: Float[Array, "2"],
    *,
    nodes: int,
    branch: float,
    extent: Extent,
    offsets: Float[Array, " h"],
    vertices: int,
    zones: Zones | None = None,
) -> Tree:
    """An RRT of `nodes` nodes with edges of length `branch` towards uniform samples (LaValle 1998).

    An edge that would enter a no-go zone is not grown: of a few samples the first whose edge is free is taken, and only
    where there is none the edge that goes farthest before it would enter one.
    """
    sides = jnp.asarray(extent, root.dtype)
    tries = () if zones is None else (_TRIES,)
    samples = jax.random.uniform(key, (nodes, *tries, 2), root.dtype) * sides
    index = jnp.arange(nodes)

    def edge(i: Int[Array, ""], position: Array, sample: Float[Array, "2"]) -> tuple[Int[Array, ""], Float[Array, "2"]]:
        """The node nearest to a sample, and the end of an edge from there towards it."""
        offset = sample - position
        squared = jnp.where(index < i, jnp.sum(offset * offset, axis=-1), jnp.inf)
        near = jnp.argmin(squared)
        distance = jnp.sqrt(squared[near])
        start = position[near]
        # Every edge is as long as a branch, past the sample if need be: with edges that end at the sample the tree
        # has fewer long paths, and Tr(P) at B = 2 is 47 instead of the paper's 39.
        return near, jnp.clip(start + (sample - start) * (branch / jnp.maximum(distance, 1e-9)), 0.0, sides)

    def free_edge(i: Int[Array, ""], position: Array) -> tuple[Int[Array, ""], Float[Array, "2"]]:
        """The first free edge towards a sample, else the longest part of one."""
        assert zones is not None
        near, end = jax.vmap(partial(edge, i, position))(samples[i])
        start = position[near]
        share = collision_free_share(zones.borders, start, end)
        run = share * jnp.sqrt(jnp.sum((end - start) ** 2, axis=-1))
        best = jnp.argmax(jnp.where(share >= 1.0, branch, 0.99 * run))
        return near[best], jnp.where(share[best] < 1.0, start[best] + share[best] * (end - start)[best], end[best])

    # What a node carries besides its position is one row of numbers: every array in a loop costs as much time as the
    # sums of a node.
    around = (jnp.broadcast_to(root, (size, 2)) for size in (vertices, offsets.shape[0]))
    first, path_of = ravel_pytree((jnp.zeros((), root.dtype), jnp.zeros((), root.dtype), *around))

    def grow(i: Int[Array, ""], tree: tuple[Array, Array]) -> tuple[Array, Array]:
        position, paths = tree
        near, end = edge(i, position, samples[i]) if zones is None else free_edge(i, position)
        start, (begun, depth, passed, measured) = position[near], path_of(paths[near])
        step = jnp.sqrt(jnp.sum((end - start) ** 2))
        crossed = (offsets > begun + DISTANCE_TOLERANCE) & (offsets <= begun + step + DISTANCE_TOLERANCE)
        share = jnp.clip((offsets - begun) / jnp.maximum(step, 1e-9), 0.0, 1.0)[:, None]
        marks = jnp.where(crossed[:, None], start + share * (end - start), measured)
        passes = jnp.where((jnp.arange(vertices) >= depth)[:, None], end, passed)
        path, _ = ravel_pytree((begun + step, depth + 1, passes, marks))
        put = partial(lax.dynamic_update_index_in_dim, index=i, axis=0)
        return put(position, end), put(paths, path)

    start = jnp.broadcast_to(root, (nodes, 2)), jnp.broadcast_to(first, (nodes, *first.shape))
    position, paths = lax.fori_loop(1, nodes, grow, start)
    length, depth, passed, marks = jax.vmap(path_of)(paths)
    return Tree(position, length, depth.astype(jnp.int32), passed, marks)


class TreePath(NamedTuple):
    """What an agent travels of a path, and what it measures on all of it."""

    waypoints: Float[Array, "w 2"]
    marks: Float[Array, "h 2"]  # where it measures
    taken: Bool[Array, " h"]  # which of them it lives to take


def better_path(
    zones: Zones,
    planned: TreePath,
    rate: Float[Array, ""],
    *,
    here: Point,
    remaining: Float[Array, ""],
    offsets: Float[Array, " h"],
    affordable: Bool[Array, " h"],
    interval: Real,
    execute: float,
    extent: Extent,
    worth: Float[Array, " q"],
    gain: Callable[[Float[Array, "k 1 2"]], Float[Array, " k"]],
) -> TreePath:
    """The planned path, of this `rate` of gain per domain unit, or the way to something farther away of a higher one.

    Where neither leads anywhere, the longest straight leg. `execute` is how far the agent goes before it plans again,
    domain units; see `best_transit` for `worth` and `gain`.
    """
    transit = best_transit(zones, here, remaining, interval, worth, gain)
    far = jnp.isfinite(transit.distance) & (transit.distance >= execute)
    points, _ = along_paths(here, transit.path[None], offsets)
    away = first_part(here, transit.path, execute)[: len(planned.waypoints)]
    end = longest_free_leg(zones, here, jnp.asarray(execute, here.dtype), extent)
    leave = far & (transit.rate > rate)
    waypoints = jnp.where(leave, away, planned.waypoints)
    marks = jnp.where(leave, points[0], planned.marks)
    taken = jnp.where(leave, affordable & (offsets <= transit.distance), planned.taken)
    went = jnp.sum(jnp.sqrt(jnp.sum(jnp.diff(waypoints, axis=0, prepend=here[None]) ** 2, axis=-1)))
    short = went < 0.1 * jnp.minimum(execute, remaining)
    return TreePath(jnp.where(short, end, waypoints), marks, taken & ~short)
