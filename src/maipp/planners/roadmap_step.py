"""What every roadmap planner shares: the due agent's roadmap, and the edges that leave it time to meet the others."""

import jax.numpy as jnp

from maipp.engine.decision import Observation
from maipp.planners.rendezvous import Rendezvous, in_time
from maipp.roadmap import Edges, Roadmap, edges_from
from maipp.typing import Array, Float, Index


def roadmap_of(observation: Observation) -> Roadmap:
    """The due agent's roadmap. Raises ValueError where the mission was drawn without roadmaps."""
    if observation.roadmap is None:
        raise ValueError("this planner moves on a roadmap: draw the missions with roadmaps=True")
    return observation.roadmap


def edges(
    roadmap: Roadmap,
    node: Index,
    remaining: Float[Array, ""],
    last_leg: str = "stop",
    meeting: Rendezvous | None = None,
) -> Edges:
    """The edges that the budget allows, see `edges_from`; with a `meeting` only those that leave time for it."""
    here = edges_from(roadmap, node, remaining, last_leg)
    if meeting is None:
        return here
    start = jnp.asarray(roadmap.nodes)[node]
    return here._replace(allowed=in_time(meeting, start, here.targets, here.allowed, remaining))
