"""The stand-in for a planner of an environment, whose decisions come from outside."""

import jax.numpy as jnp

from maipp.engine.decision import Planner, PyTree
from maipp.typing import Array, Float


class Announcer(Planner):
    """Says what the engine must know of decisions that come from outside: one waypoint each, which is announced."""

    uses_roadmap = True
    avoids_obstacles = True

    def empty_message(self) -> PyTree:
        """The announced target: position (2,), NaN before the first decision and after the last."""
        return nothing_told()


def nothing_told() -> Float[Array, "2"]:
    """The message of an agent that heads nowhere."""
    return jnp.full(2, jnp.nan, jnp.result_type(float))
