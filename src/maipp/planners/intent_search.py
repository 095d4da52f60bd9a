"""`intent-search`: paths sampled from the policy and random plans in the plane, the best of both refined by gradient.

The policy has learned where surveys pay in the long run, but only knows the nodes of its roadmap; the search finds the
best next legs in the plane, but looks no farther than they reach.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option, part
from maipp.engine.polyline import along_paths
from maipp.errors import InputError
from maipp.planners.announced.announcement import Announcement, nothing_announced
from maipp.planners.paths.path_sampler import PathSampler
from maipp.planners.paths.paths import AgentState, Paths
from maipp.planners.roadmap.edges import roadmap_of
from maipp.planners.search.outlook import Ahead
from maipp.planners.search.plan_search import LegMemory, PlanSearch
from maipp.policy import Memory
from maipp.problem import longest_side
from maipp.team import COVARIANCE_FLOOR, Intent, fit_intent, fuse_intents
from maipp.typing import Array, Float, Key


class SearchMemory(eqx.Module):
    """What an agent remembers from decision to decision."""

    trajectory: Memory  # the network's, of the executed trajectory
    legs: LegMemory


class IntentSearch(Planner):
    """Refines the best of `paths` sampled paths of `nodes` nodes and of random plans; travels one leg, plans again.

    Agents tell each other where and when they mean to measure; the intent that the policy is shown is fitted to that.
    """

    search: PlanSearch = part(PlanSearch, candidates=48)
    sampler: PathSampler = part(PathSampler)
    paths: int = option(16, meaning="trajectories sampled from the policy per decision")
    nodes: int = option(6, meaning="nodes of each path")
    distinct: bool = option(True, meaning="the paths' first steps differ, as far as they can")

    uses_roadmap = True
    avoids_obstacles = True

    def check(self) -> None:
        """Raise InputError for options out of range."""
        for name in ("paths", "nodes"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}={getattr(self, name)}: give a whole number >= 1")

    @property
    def waypoints_per_decision(self) -> int:
        """Those of a leg."""
        return self.search.waypoints

    @property
    def missions_per_core(self) -> int:
        """As without a policy: the search in the plane is what takes the time, and 8 at a time gained nothing."""
        return self.search.missions_per_core

    def empty_message(self) -> PyTree:
        """The announced measurements."""
        return nothing_announced(self.search.legs)

    def initial_memory(self) -> PyTree:
        """Nothing travelled, planned or heard."""
        return SearchMemory(self.sampler.policy.initial_memory(), self.search.first_memory())

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The first leg of the best plan found."""
        search, sampler = self.search, self.sampler
        path_key, search_key = jax.random.split(key)
        ahead = search.ahead(observation)
        belief, heard = search.counted(observation, memory.legs.heard)

        situation = sampler.agent_state(observation, observation.at_nodes, self._map(observation, heard))
        insight = sampler.look(situation, memory.trajectory)
        paths = sampler.sample(path_key, situation, insight, paths=self.paths, steps=self.nodes, distinct=self.distinct)
        outlook, proposals = search.outlook(observation, belief, ahead), self._proposals(situation, paths, ahead)
        plan = search.plan(search_key, outlook, memory.legs.plan, proposals).best
        way, message, left = search.set_out(observation, outlook, plan, ahead)
        return Decision(way, message, SearchMemory(insight.memory, LegMemory(left, heard)))

    def _map(self, observation: Observation, heard: Announcement) -> Float[Array, " n"]:
        """The others' fused intent at the nodes: Gaussians fitted to what each has announced."""
        told = jnp.isfinite(heard.times) & (observation.heard | self.search.recall)[:, None]
        floor = COVARIANCE_FLOOR * longest_side(self.scenario.extent) ** 2
        intents: Intent = jax.vmap(lambda points, mask: fit_intent(points, mask, floor))(heard.points, told)
        return fuse_intents(intents, told.any(axis=1), jnp.asarray(roadmap_of(observation).nodes))

    def _proposals(self, situation: AgentState, paths: Paths, ahead: Ahead) -> Float[Array, "a h 2"]:
        """The sampled paths as plans: from one measurement to the next, units of a leg."""
        nodes = jnp.asarray(situation.roadmap.nodes)[paths.nodes]
        points, _ = along_paths(situation.position, nodes, ahead.offsets)
        begins = jnp.concatenate([jnp.broadcast_to(situation.position, (len(points), 1, 2)), points[:, :-1]], axis=1)
        return (points - begins) / jnp.maximum(ahead.steps, 1e-9)[:, None]
