"""A policy trained outside of maipp as a planner: `jax_ppo.py` writes the weights, this asks them."""

import jax
import jax.numpy as jnp
import numpy as np
from jax_ppo import network

from maipp.engine import Decision, Planner, option
from maipp.environments import see
from maipp.errors import InputError
from maipp.planners.roadmap.edges import roadmap_of
from maipp.roadmap import nearest_node


class MyPolicy(Planner):
    """The neighbour that the network likes best."""

    weights: str = option("policy.npz", meaning="file that jax_ppo.py wrote")

    uses_roadmap = True
    avoids_obstacles = True

    def check(self) -> None:
        """Refuse a file that is not there."""
        try:
            np.load(self.weights).close()
        except (OSError, ValueError) as error:
            raise InputError(f"weights: {self.weights}: {error}; give a file that jax_ppo.py wrote") from None

    def empty_message(self) -> jax.Array:
        """Where the robot is heading, as in the environment; NaN before its first decision."""
        return jnp.full(2, jnp.nan)

    def decide(self, key, observation, memory) -> Decision:
        """One step along the roadmap; the end of the survey where there is none."""
        seen = see(self.scenario, observation)
        logits, _ = network(dict(np.load(self.weights)), *seen[:2])
        choice, roadmap = jnp.argmax(logits), roadmap_of(observation)
        target = roadmap.nodes[roadmap.neighbours[nearest_node(roadmap, observation.position), choice]]
        return Decision(target[None], target, memory, stop=~seen.action_mask.any())
