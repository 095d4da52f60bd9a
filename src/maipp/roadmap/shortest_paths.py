"""Shortest ways around no-go zones, from where an agent is."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.roadmap.collision import collision_free_share, is_collision_free
from maipp.roadmap.zones import Borders, Zones
from maipp.typing import Array, Extent, Float, Index, Int, Point

# Waypoints of a way that are looked up: turns, and its end if it comes this early. Whoever travels looks again.
TURNS = 5

# Directions tried by an agent that has nowhere better to go.
_DIRECTIONS = 32


def sight(borders: Borders, here: Point) -> Float[Array, " v"]:
    """Distance to each corner of the zones that is in sight from `here`, domain units; inf for the others."""
    offset = borders.corners - here
    distance = jnp.sqrt(jnp.sum(offset * offset, axis=-1))
    return jnp.where(is_collision_free(borders, here, borders.corners), distance, jnp.inf)


class ShortestPaths(NamedTuple):
    """Shortest ways from one point to some others."""

    ends: Float[Array, "t 2"]
    length: Float[Array, " t"]  # domain units; inf where there is none
    first: Int[Array, " t"]  # the corner that each turns at first; -1 for the straight ones
    onward: Float[Array, "v t"]  # length of the shortest way from each corner to each end


def shortest_paths(zones: Zones, here: Point, ends: Float[Array, "t 2"], onward: Float[Array, "v t"]) -> ShortestPaths:
    """Shortest ways from `here` to `ends`, to which `onward` has the ways from the corners."""
    offset = ends - here
    straight = jnp.where(
        is_collision_free(zones.borders, here, ends), jnp.sqrt(jnp.sum(offset * offset, axis=-1)), jnp.inf
    )
    around = sight(zones.borders, here)[:, None] + onward
    best = jnp.argmin(around, axis=0).astype(jnp.int32)
    shortest = jnp.min(around, axis=0)
    return ShortestPaths(ends, jnp.minimum(straight, shortest), jnp.where(straight <= shortest, -1, best), onward)


def waypoints(zones: Zones, ways: ShortestPaths, index: Index) -> Float[Array, "w 2"]:
    """The first waypoints of way number `index`; its end again and again once it is reached."""
    end, onward = ways.ends[index], ways.onward[:, index]
    corner, points = ways.first[index], []
    for _ in range(TURNS):
        points.append(jnp.where(corner < 0, end, zones.borders.corners[corner]))
        via = zones.legs[corner] + onward
        # A leg straight to the end is no longer than by way of another corner.
        ahead = jnp.min(via) <= onward[corner] * (1.0 + 1e-6)
        corner = jnp.where((corner < 0) | ~ahead, -1, jnp.argmin(via).astype(jnp.int32))
    return jnp.stack(points)


def longest_free_leg(zones: Zones, here: Point, step: Float[Array, ""], extent: Extent) -> Point:
    """The end of the longest straight leg from `here`, of those up to `step` long (domain units)."""
    angle = 2.0 * jnp.pi / _DIRECTIONS * jnp.arange(_DIRECTIONS)
    ends = here + step * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
    # In a narrow passage only its corners may be in sight.
    offset = zones.borders.corners - here
    distance = jnp.sqrt(jnp.sum(offset * offset, axis=-1, keepdims=True))
    ends = jnp.concatenate([ends, here + offset * jnp.minimum(step / jnp.maximum(distance, 1e-9), 1.0)])
    ends = jnp.clip(ends, 0.0, jnp.asarray(extent, here.dtype))
    share = collision_free_share(zones.borders, here, ends)
    run = share * jnp.sqrt(jnp.sum((ends - here) ** 2, axis=-1))
    best = jnp.argmax(run)
    return here + share[best] * (ends[best] - here)
