"""Shortest ways on a roadmap: out of bays and around islands, where no neighbour of a node is worth anything."""

from collections.abc import Callable

import jax.numpy as jnp
from jax import lax

from maipp.roadmap import Roadmap
from maipp.typing import Array, Float, Index, Int


def lengths_from(roadmap: Roadmap, node: Index) -> Float[Array, " n"]:
    """Length of the shortest way from a node to each node, domain units; inf where there is none."""
    neighbours, legs, start = _legs(roadmap, node)
    return _settled(start, lambda length: length.at[neighbours].min(length[:, None] + legs))


def lengths_to(roadmap: Roadmap, node: Index) -> Float[Array, " n"]:
    """Length of the shortest way from each node to a node, domain units; inf where there is none."""
    neighbours, legs, start = _legs(roadmap, node)
    return _settled(start, lambda length: jnp.minimum(length, jnp.min(legs + length[neighbours], axis=1)))


def _legs(roadmap: Roadmap, node: Index) -> tuple[Int[Array, "n k"], Float[Array, "n k"], Float[Array, " n"]]:
    """Neighbours, the lengths of the legs to them, and the length of the way between each node and `node` so far."""
    neighbours, legs = jnp.asarray(roadmap.neighbours), jnp.asarray(roadmap.distances)
    start = jnp.where(jnp.arange(len(neighbours)) == node, 0.0, jnp.inf).astype(legs.dtype)
    return neighbours, jnp.where(jnp.asarray(roadmap.reachable), legs, jnp.inf), start


def _settled(start: Array, shorten: Callable[[Array], Array]) -> Array:
    """What is left once nothing gets shorter any more (Bellman-Ford)."""

    def go_on(state: tuple[Array, Array]) -> Array:
        return state[1]

    def again(state: tuple[Array, Array]) -> tuple[Array, Array]:
        shorter = shorten(state[0])
        return shorter, jnp.any(shorter < state[0])

    return lax.while_loop(go_on, again, (start, jnp.asarray(True)))[0]
