"""Legs: polylines that an agent travels from one decision to the next."""

import jax.numpy as jnp

from maipp.typing import Array, Extent, Float


def along(polyline: Float[Array, "v 2"], distance: Float[Array, "..."]) -> Float[Array, "... 2"]:
    """Points at given distances along a polyline, clamped to its ends (domain units)."""
    steps = jnp.sqrt(jnp.sum((polyline[1:] - polyline[:-1]) ** 2, axis=-1))
    position = jnp.broadcast_to(polyline[0], (*jnp.shape(distance), 2))
    done = jnp.zeros((), polyline.dtype)
    for i in range(polyline.shape[0] - 1):
        share = jnp.clip((distance - done) / jnp.maximum(steps[i], 1e-12), 0.0, 1.0)[..., None]
        # The end of an edge is that vertex exactly: a sum of edges may round to a point outside the domain.
        position = jnp.where(share < 1.0, position + share * (polyline[i + 1] - polyline[i]), polyline[i + 1])
        done = done + steps[i]
    return position


def cut_leg(
    extent: Extent, position: Float[Array, "2"], waypoints: Float[Array, "w 2"], remaining: Float[Array, ""]
) -> tuple[Float[Array, "v 2"], Float[Array, " w"]]:
    """The leg from `position` through the waypoints, within the domain and cut where `remaining` (domain units) ends.

    Also the distance from the position to each waypoint of the leg, the last of which is its length.
    """
    planned = jnp.concatenate([position[None], jnp.clip(waypoints, 0.0, jnp.asarray(extent, position.dtype))])
    lengths = jnp.cumsum(jnp.sqrt(jnp.sum((planned[1:] - planned[:-1]) ** 2, axis=-1)))
    reach = jnp.minimum(lengths, remaining)
    return jnp.concatenate([position[None], along(planned, reach)]), reach
