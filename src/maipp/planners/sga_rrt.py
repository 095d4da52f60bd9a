"""`sga-rrt`: sequential greedy assignment over the branches of a random tree (paper Sec. V-A, Table I)."""

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.flatten_util import ravel_pytree

from maipp.belief import Belief, to_rank
from maipp.engine.decision import Decision, Observation, PyTree, option
from maipp.engine.polyline import along_paths, first_part
from maipp.errors import InputError
from maipp.planners.announced import Announcement, nothing_announced, with_announced
from maipp.planners.lookahead import measurement_offsets, predicted_trace
from maipp.planners.plane_planner import PlanePlanner
from maipp.planners.transit import best_transit
from maipp.roadmap.free_run import free_share
from maipp.roadmap.ways import long_run
from maipp.roadmap.zones import Zones
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Extent, Float, Int, Key

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
        share = free_share(zones.borders, start, end)
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


class SgaRrt(PlanePlanner):
    """Among tree paths with a length in `lengths`, the one with the lowest predicted Tr(P); travel part of it, replan.

    Agents plan in sequence: each counts the measurements that the others have announced on their planned paths.
    """

    lengths: tuple[float, float] = option((0.3, 0.4), meaning="shortest and longest path, domain units")
    nodes: int = option(90, meaning="of the tree, root included")
    branch: float = option(0.1, meaning="edge length, domain units")
    execute: float = option(0.2, meaning="part of the path travelled before replanning")

    def check(self) -> None:
        """Raise InputError for options that make no tree or no path."""
        low, high = self.lengths
        if not 0 < low <= high:
            raise InputError(f"lengths={low},{high}: give 0 < shortest <= longest, e.g. 0.3,0.4")
        if self.branch > high:
            raise InputError(f"branch={self.branch} is longer than the longest path, {high}; give at most that")
        if self.nodes < 2:
            raise InputError(f"nodes={self.nodes}: a tree needs at least 2")
        if not self.branch > 0 or not self.execute > 0:
            raise InputError(f"branch={self.branch}, execute={self.execute}: both are lengths > 0")

    @property
    def waypoints_per_decision(self) -> int:
        """Edges on the executed part of a path; one more, since edges that end at the border are shorter."""
        return math.ceil(self.execute / self.branch - 1e-6) + 1

    @property
    def horizon(self) -> int:
        """Most measurements on a candidate path."""
        return max(1, math.ceil(self.lengths[1] / self.scenario.finest_interval - 1e-6))

    def empty_message(self) -> PyTree:
        """The announced path, as the measurements on it."""
        return nothing_announced(self.horizon)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The first part of the best path of a fresh tree."""
        offsets = measurement_offsets(observation.to_next_measurement, self.scenario.measurement_interval, self.horizon)
        tree = grow_tree(
            key,
            observation.position,
            nodes=self.nodes,
            branch=self.branch,
            extent=self.scenario.extent,
            offsets=offsets,
            vertices=self.waypoints_per_decision,
            zones=self.zones,
        )
        belief = with_announced(observation, observation.messages, self.scenario.virtual_value)
        low, high = self.lengths
        candidate = (tree.length >= low - DISTANCE_TOLERANCE) & (tree.length <= high + DISTANCE_TOLERANCE)
        # Small or crowded domains can leave no path that long: then the longest ones compete.
        longest = jnp.max(jnp.where(tree.length <= high + DISTANCE_TOLERANCE, tree.length, 0.0))
        candidate = jnp.where(candidate.any(), candidate, tree.length == longest)
        affordable = offsets <= observation.remaining + DISTANCE_TOLERANCE
        taken = (offsets <= tree.length[:, None] + DISTANCE_TOLERANCE) & affordable
        # About a quarter of a tree's nodes are candidates: score no more than half of them.
        ranked, some = lax.top_k(candidate.astype(jnp.float32), max(1, self.nodes // 2))
        score = predicted_trace(
            belief,
            self.interest,
            observation.inside,
            tree.marks[some],
            taken[some],
            virtual_value=self.scenario.virtual_value,
        )
        score = jnp.where(ranked > 0, to_rank(score), jnp.inf)
        best = some[jnp.argmin(score)]
        times = jnp.where(taken[best], observation.time + offsets / observation.speed, jnp.inf)
        waypoints = first_part(observation.position, tree.vertices[best], self.execute)
        marks = tree.marks[best]
        if self.zones is not None:
            left, length = jnp.min(score), tree.length[best]
            planned = (waypoints, marks, taken[best])
            waypoints, marks, measured = self._better(observation, belief, planned, left, length, offsets, affordable)
            times = jnp.where(measured, observation.time + offsets / observation.speed, jnp.inf)
        return Decision(waypoints, Announcement(marks, times), memory)

    def _better(
        self,
        observation: Observation,
        belief: Belief,
        planned: tuple[Array, Array, Array],
        left: Float[Array, ""],
        length: Float[Array, ""],
        offsets: Float[Array, " h"],
        affordable: Bool[Array, " h"],
    ) -> tuple[Array, Array, Array]:
        """Waypoints, marks and which of them are taken, for what lowers Tr(P) most for its length.

        That is the planned path, of that `length`, which leaves Tr(P) at `left`, or the way to something farther away;
        where neither leads anywhere, the longest straight leg.
        """
        zones, position, inside = self.zones, observation.position, observation.inside
        assert zones is not None
        interval, virtual = self.scenario.measurement_interval, self.scenario.virtual_value
        area = self.interest.area(belief.mean, belief.variance, inside)
        worth = jnp.where(area, belief.variance, 0.0)
        now = jnp.sum(worth)

        def gain(points: Float[Array, "k 1 2"]) -> Float[Array, " k"]:
            taken = jnp.ones(points.shape[:-1], bool)
            return now - predicted_trace(belief, self.interest, inside, points, taken, virtual_value=virtual)

        transit = best_transit(zones, position, observation.remaining, interval, worth, gain)
        far = jnp.isfinite(transit.distance) & (transit.distance >= self.execute)
        points, _ = along_paths(position, transit.path[None], offsets)
        away = first_part(position, transit.path, self.execute)[: self.waypoints_per_decision]
        end = long_run(zones, position, jnp.asarray(self.execute, position.dtype), self.scenario.extent)
        leave = far & (transit.rate > (now - left) / jnp.maximum(length, interval))
        waypoints, marks, taken = planned
        waypoints = jnp.where(leave, away, waypoints)
        marks = jnp.where(leave, points[0], marks)
        taken = jnp.where(leave, affordable & (offsets <= transit.distance), taken)
        went = jnp.sum(jnp.sqrt(jnp.sum(jnp.diff(waypoints, axis=0, prepend=position[None]) ** 2, axis=-1)))
        short = went < 0.1 * jnp.minimum(self.execute, observation.remaining)
        return jnp.where(short, end, waypoints), marks, taken & ~short
