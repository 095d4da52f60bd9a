"""`sga-rrt`: sequential greedy assignment over the branches of a random tree (paper Sec. IV-A, Table I)."""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from maipp.errors import InputError
from maipp.planners.announced import Announcement, nothing_announced, with_announced
from maipp.planners.lookahead import measurement_offsets, predicted_trace
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.simulator.decision import Decision, Observation, Planner, PyTree
from maipp.simulator.state import along
from maipp.typing import Array, Float, Int, Key


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
    extent: tuple[float, float],
    offsets: Float[Array, " h"],
    vertices: int,
) -> Tree:
    """An RRT of `nodes` nodes with edges of length `branch` towards uniform samples (LaValle 1998)."""
    sides = jnp.asarray(extent, root.dtype)
    samples = jax.random.uniform(key, (nodes, 2), root.dtype) * sides
    index = jnp.arange(nodes)
    tree = Tree(
        position=jnp.broadcast_to(root, (nodes, 2)),
        length=jnp.zeros(nodes, root.dtype),
        depth=jnp.zeros(nodes, jnp.int32),
        vertices=jnp.broadcast_to(root, (nodes, vertices, 2)),
        marks=jnp.broadcast_to(root, (nodes, offsets.shape[0], 2)),
    )

    def grow(i: Int[Array, ""], tree: Tree) -> Tree:
        offset = samples[i] - tree.position
        squared = jnp.where(index < i, jnp.sum(offset * offset, axis=-1), jnp.inf)
        near = jnp.argmin(squared)
        distance = jnp.sqrt(squared[near])
        start, begun = tree.position[near], tree.length[near]
        # Every edge is as long as a branch, past the sample if need be: with edges that end at the sample the tree
        # has fewer long paths, and Tr(P) at B = 2 is 47 instead of the paper's 39.
        end = jnp.clip(start + (samples[i] - start) * (branch / jnp.maximum(distance, 1e-9)), 0.0, sides)
        step = jnp.sqrt(jnp.sum((end - start) ** 2))
        crossed = (offsets > begun + DISTANCE_TOLERANCE) & (offsets <= begun + step + DISTANCE_TOLERANCE)
        share = jnp.clip((offsets - begun) / jnp.maximum(step, 1e-9), 0.0, 1.0)[:, None]
        marks = jnp.where(crossed[:, None], start + share * (end - start), tree.marks[near])
        path = jnp.where((jnp.arange(vertices) >= tree.depth[near])[:, None], end, tree.vertices[near])
        here = index == i
        return Tree(
            position=jnp.where(here[:, None], end, tree.position),
            length=jnp.where(here, begun + step, tree.length),
            depth=jnp.where(here, tree.depth[near] + 1, tree.depth),
            vertices=jnp.where(here[:, None, None], path, tree.vertices),
            marks=jnp.where(here[:, None, None], marks, tree.marks),
        )

    return lax.fori_loop(1, nodes, grow, tree)


class SgaRrt(Planner):
    """Among tree paths with a length in `lengths`, the one with the lowest predicted Tr(P); travel part of it, replan.

    Agents plan in sequence: each counts the measurements that the others have announced on their planned paths.
    """

    lengths: tuple[float, float] = eqx.field(static=True, default=(0.3, 0.4))  # inclusive, domain units
    nodes: int = eqx.field(static=True, default=90)  # of the tree, root included
    branch: float = eqx.field(static=True, default=0.1)  # edge length, domain units
    execute: float = eqx.field(static=True, default=0.2)  # part of the path travelled before replanning

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
        return max(1, math.ceil(self.lengths[1] / self.scenario.measurement_interval - 1e-6))

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
        best = some[jnp.argmin(jnp.where(ranked > 0, score, jnp.inf))]
        times = jnp.where(taken[best], observation.time + offsets / observation.speed, jnp.inf)
        waypoints = _first_part(observation.position, tree.vertices[best], self.execute)
        return Decision(waypoints, Announcement(tree.marks[best], times), memory)


def _first_part(start: Float[Array, "2"], vertices: Float[Array, "w 2"], length: float) -> Float[Array, "w 2"]:
    """The path's vertices, cut where it is `length` long."""
    path = jnp.concatenate([start[None], vertices])
    reach = jnp.cumsum(jnp.sqrt(jnp.sum((path[1:] - path[:-1]) ** 2, axis=-1)))
    return along(path, jnp.minimum(reach, length))
