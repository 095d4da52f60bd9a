"""`sga-rrt`: sequential greedy assignment over the branches of a random tree (paper Sec. V-A, Table I)."""

import math

import equinox as eqx
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, to_rank
from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option
from maipp.engine.polyline import first_part
from maipp.errors import InputError
from maipp.planners.announced.announcement import Announcement, nothing_announced, with_announced
from maipp.planners.lookahead import measurement_offsets, predicted_trace
from maipp.planners.plane.planner_zones import planner_zones
from maipp.planners.plane.tree import TreePath, better_path, grow_tree
from maipp.roadmap.zones import Zones
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Key


class SgaRrt(Planner):
    """Among tree paths with a length in `lengths`, the one with the lowest predicted Tr(P); travel part of it, replan.

    Agents plan in sequence: each counts the measurements that the others have announced on their planned paths.
    """

    lengths: tuple[float, float] = option((0.3, 0.4), meaning="shortest and longest path, domain units")
    nodes: int = option(90, meaning="of the tree, root included")
    branch: float = option(0.1, meaning="edge length, domain units")
    execute: float = option(0.2, meaning="part of the path travelled before replanning")

    zones: Zones | None = eqx.field(default=None, kw_only=True)  # None: those of the scenario, if it has any

    avoids_obstacles = True

    def __post_init__(self) -> None:
        if self.zones is None:
            self.zones = planner_zones(self.scenario)

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
        path = TreePath(
            first_part(observation.position, tree.vertices[best], self.execute), tree.marks[best], taken[best]
        )
        if self.zones is not None:
            path = self._better(observation, belief, path, jnp.min(score), tree.length[best], offsets, affordable)
        times = jnp.where(path.taken, observation.time + offsets / observation.speed, jnp.inf)
        return Decision(path.waypoints, Announcement(path.marks, times), memory)

    def _better(
        self,
        observation: Observation,
        belief: Belief,
        path: TreePath,
        left: Float[Array, ""],
        length: Float[Array, ""],
        offsets: Float[Array, " h"],
        affordable: Bool[Array, " h"],
    ) -> TreePath:
        """What lowers Tr(P) most for its length: the path, of that `length`, leaves Tr(P) at `left`."""
        interval, virtual = self.scenario.measurement_interval, self.scenario.virtual_value
        area = self.interest.area(belief.mean, belief.variance, observation.inside)
        worth = jnp.where(area, belief.variance, 0.0)
        now = jnp.sum(worth)

        def gain(points: Float[Array, "k 1 2"]) -> Float[Array, " k"]:
            taken = jnp.ones(points.shape[:-1], bool)
            left = predicted_trace(belief, self.interest, observation.inside, points, taken, virtual_value=virtual)
            return now - left

        assert self.zones is not None
        return better_path(
            self.zones,
            path,
            (now - left) / jnp.maximum(length, interval),
            here=observation.position,
            remaining=observation.remaining,
            offsets=offsets,
            affordable=affordable,
            interval=interval,
            execute=self.execute,
            extent=self.scenario.extent,
            worth=worth,
            gain=gain,
        )
