"""Where an agent stands on its roadmap, and which edges its budget allows."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.roadmap.prm import Roadmap
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index, Int, Point

# Legs up to this go nowhere, and whoever goes nowhere has stopped. Twice what the engine says, so that rounding never
# makes the engine stop an agent that has a leg ahead of it.
SHORTEST_LEG = 2 * DISTANCE_TOLERANCE


class Edges(NamedTuple):
    """The edges that leave a node."""

    node: Int[Array, ""]  # the node
    targets: Float[Array, "k 2"]  # positions of its neighbours, domain units
    target_nodes: Int[Array, " k"]  # their indices
    lengths: Float[Array, " k"]  # edge lengths, domain units
    allowed: Bool[Array, " k"]  # not pruned, and within the remaining budget


def nearest_node(roadmap: Roadmap, position: Point) -> Index:
    """The roadmap node nearest to a position (domain units)."""
    offset = jnp.asarray(roadmap.nodes) - position
    return jnp.argmin(jnp.sum(offset * offset, axis=-1)).astype(jnp.int32)


def edges_from(roadmap: Roadmap, node: Index, remaining: Float[Array, ""], last_leg: str = "stop") -> Edges:
    """The edges from `node` to its neighbours that the remaining budget (domain units) allows.

    `last_leg="stop"` allows edges no longer than the remaining budget, so an agent stops where it reaches no neighbour;
    `"cut"` allows every edge while any budget is left, and the engine cuts the leg at the budget. Edges between nodes
    that all but coincide are never allowed.
    """
    target_nodes = jnp.asarray(roadmap.neighbours)[node]
    lengths = jnp.asarray(roadmap.distances)[node]
    within = lengths <= remaining + DISTANCE_TOLERANCE if last_leg == "stop" else remaining > SHORTEST_LEG
    allowed = jnp.asarray(roadmap.reachable)[node] & within & (lengths > SHORTEST_LEG)
    return Edges(node, jnp.asarray(roadmap.nodes)[target_nodes], target_nodes, lengths, allowed)
