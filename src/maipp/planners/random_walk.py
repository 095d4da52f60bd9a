"""`random`: a uniform random walk on the roadmap, the floor under every other planner."""

import jax
import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.planners.announced.meeting import appointment
from maipp.planners.roadmap.edges import feasible_edges
from maipp.typing import Key


class RandomWalk(Planner):
    """Each step goes to a uniformly drawn neighbour that the budget can reach."""

    uses_roadmap = True
    avoids_obstacles = True

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """A random reachable neighbour; stops when there is none."""
        here = feasible_edges(self.scenario, observation, appointment(self.scenario, observation, meet=False))
        choice = jax.random.categorical(key, jnp.where(here.allowed, 0.0, -jnp.inf))
        return Decision(here.targets[choice][None], self.empty_message(), memory, ~here.allowed.any())
