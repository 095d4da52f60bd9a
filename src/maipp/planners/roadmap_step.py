"""What every roadmap planner shares: where it stands on its roadmap and which edges its budget allows."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.engine.decision import Observation
from maipp.planners.rendezvous import Rendezvous, in_time
from maipp.roadmap import Roadmap
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index, Int


class Edges(NamedTuple):
    """The edges that leave a node."""

    node: Int[Array, ""]  # the node
    targets: Float[Array, "k 2"]  # positions of its neighbours, domain units
    target_nodes: Int[Array, " k"]  # their indices
    lengths: Float[Array, " k"]  # edge lengths, domain units
    allowed: Bool[Array, " k"]  # not pruned, and within the remaining budget


def roadmap_of(observation: Observation) -> Roadmap:
    """The due agent's roadmap. Raises ValueError where the mission was drawn without roadmaps."""
    if observation.roadmap is None:
        raise ValueError("this planner moves on a roadmap: draw the missions with roadmaps=True")
    return observation.roadmap


def current_node(roadmap: Roadmap, position: Float[Array, "2"]) -> Index:
    """The roadmap node nearest to a position."""
    offset = jnp.asarray(roadmap.nodes) - position
    return jnp.argmin(jnp.sum(offset * offset, axis=-1)).astype(jnp.int32)


def edges(
    roadmap: Roadmap,
    node: Index,
    remaining: Float[Array, ""],
    last_leg: str = "stop",
    meeting: Rendezvous | None = None,
) -> Edges:
    """The edges from `node` to its neighbours that the remaining budget allows.

    `last_leg="stop"` allows edges no longer than the remaining budget, so an agent stops where it reaches no neighbour;
    `"cut"` allows every edge while any budget is left, and the engine cuts the leg at the budget. With a `meeting` only
    edges from whose ends the agent can still get there in time.
    """
    target_nodes = jnp.asarray(roadmap.neighbours)[node]
    lengths = jnp.asarray(roadmap.distances)[node]
    within = lengths <= remaining + DISTANCE_TOLERANCE if last_leg == "stop" else remaining > DISTANCE_TOLERANCE
    # An edge of length zero (coincident nodes) goes nowhere, and an agent that goes nowhere has stopped.
    allowed = jnp.asarray(roadmap.reachable)[node] & within & (lengths > DISTANCE_TOLERANCE)
    targets = jnp.asarray(roadmap.nodes)[target_nodes]
    if meeting is not None:
        allowed = in_time(meeting, jnp.asarray(roadmap.nodes)[node], targets, allowed, remaining)
    return Edges(node, targets, target_nodes, lengths, allowed)
