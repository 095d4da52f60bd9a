"""Plans in the plane that never leave the domain: straight legs as headings, bent legs as displacements."""

import jax.numpy as jnp

from maipp.roadmap.collision import cut, is_collision_free
from maipp.roadmap.zones import Zones
from maipp.typing import Array, Extent, Float

# Places on the ellipse of a bent leg that are tried where there are no-go zones; a multiple of 4.
_BENDS = 16


def walk(
    start: Float[Array, "*#c 2"], headings: Float[Array, "*c h"], steps: Float[Array, " h"], extent: Extent
) -> Float[Array, "*c h 2"]:
    """Ends of the legs of lengths `steps` (domain units) along `headings` (radians).

    A leg that would cross the border is turned to end on it, still as long as its step, so that the next measurement
    falls on its end. Smooth in the headings between such turns.
    """
    x, y = (
        jnp.broadcast_arrays(start[..., 0], headings[..., 0])[0],
        jnp.broadcast_arrays(start[..., 1], headings[..., 0])[0],
    )
    points: list[Array] = []
    for i in range(headings.shape[-1]):
        step = steps[i]
        x, y = _leg(x, y, step * jnp.cos(headings[..., i]), step * jnp.sin(headings[..., i]), step, extent)
        points.append(jnp.stack([x, y], axis=-1))
    return jnp.stack(points, axis=-2)


def _leg(x: Array, y: Array, dx: Array, dy: Array, step: Array, extent: Extent) -> tuple[Array, Array]:
    """End of one leg, turned where it would leave the domain."""
    width, height = extent
    # Compared with the border and not with the clipped end: compiled, the same sum may round differently in two places,
    # and a leg that only seems to be turned may go to the other side.
    turned = _beyond(x + dx, width)
    inside_x = jnp.clip(x + dx, 0.0, width)
    # What the border takes from x goes to y, towards the side with more room where the leg was straight at the border.
    sideways = jnp.where(turned, jnp.copysign(_rest(step, inside_x - x), dy), dy)
    sideways = jnp.where(turned & _beyond(y + sideways, height), -sideways, sideways)
    inside_y = jnp.clip(y + sideways, 0.0, height)
    across = jnp.copysign(_rest(step, inside_y - y), dx)
    across = jnp.where(_beyond(x + across, width), -across, across)
    turned_y = ~turned & _beyond(y + sideways, height)
    return jnp.where(turned_y, jnp.clip(x + across, 0.0, width), inside_x), inside_y


def _beyond(place: Array, size: Array | float) -> Array:
    return (place < 0.0) | (place > size)


def _rest(step: Array, moved: Array) -> Array:
    """What is left of a leg across the way it moved."""
    return jnp.sqrt(jnp.maximum(step * step - moved * moved, 1e-12))


def walk_bent(
    start: Float[Array, "2"],
    displacements: Float[Array, "*c h 2"],
    steps: Float[Array, " h"],
    extent: Extent,
    zones: Zones | None = None,
) -> Float[Array, "*c h 2"]:
    """Ends of legs that may bend, so that a leg of length `steps` (domain units) ends at most that far away.

    `displacements` are in units of the leg; longer ones are shortened to 1. A leg that would leave the domain ends at
    the nearest point of its border, one that would enter a no-go zone ends before it. Smooth in the displacements
    between such points.
    """
    moves = steps[:, None] * within_leg(displacements)
    point = jnp.broadcast_to(start, (*displacements.shape[:-2], 2))
    points: list[Array] = []
    for i in range(displacements.shape[-2]):
        before, point = point, jnp.clip(point + moves[..., i, :], 0.0, jnp.asarray(extent, start.dtype))
        if zones is not None:
            point = cut(zones.borders, before, point)
        points.append(point)
    return jnp.stack(points, axis=-2)


def within_leg(displacements: Float[Array, "*c 2"]) -> Float[Array, "*c 2"]:
    """Displacements in units of the leg, those longer than 1 shortened to 1."""
    squared = jnp.sum(displacements * displacements, axis=-1, keepdims=True)
    # A root of at least one: its slope stays finite.
    return displacements / jnp.sqrt(jnp.maximum(squared, 1.0))


def bend(
    start: Float[Array, "2"],
    end: Float[Array, "2"],
    length: Float[Array, ""],
    extent: Extent,
    zones: Zones | None = None,
) -> Float[Array, "2"]:
    """Where a leg bends that takes `length` (domain units) from `start` to an `end` at most that far away.

    Of the four ends of the axes of the ellipse with these foci, the one that stays in the domain and nearest to its
    centre. Where a leg is longer than the domain is wide there may be none: the point is clipped, the way shorter.
    With no-go zones more points of the ellipse are tried, and both parts of the way must keep out of them; where no
    point does, the leg goes straight and is shorter.
    """
    size = jnp.asarray(extent, start.dtype)
    across = end - start
    squared = jnp.sum(across * across)
    far = squared > 1e-10
    along = jnp.where(far, across / jnp.sqrt(jnp.where(far, squared, 1.0)), jnp.asarray([1.0, 0.0], start.dtype))
    minor = 0.5 * jnp.sqrt(jnp.maximum(length * length - squared, 0.0))
    aside, ahead = minor * jnp.stack([-along[1], along[0]]), 0.5 * length * along
    middle = 0.5 * (start + end)
    corners = middle + jnp.stack([aside, -aside, ahead, -ahead])
    if zones is not None:
        angle = 2.0 * jnp.pi / _BENDS * jnp.arange(_BENDS)[:, None]
        corners = middle + jnp.cos(angle) * ahead + jnp.sin(angle) * aside
    outside = jnp.sum(jnp.abs(corners - jnp.clip(corners, 0.0, size)), axis=-1)
    offset = jnp.sum((corners - 0.5 * size) ** 2, axis=-1)
    if zones is not None:
        allowed = (
            (outside == 0)
            & is_collision_free(zones.borders, start, corners)
            & is_collision_free(zones.borders, end, corners)
        )
        return jnp.where(allowed.any(), corners[jnp.argmin(jnp.where(allowed, offset, jnp.inf))], end)
    best = jnp.argmin(jnp.where(outside > 0, 1e3 * (1.0 + outside), 0.0) + offset)
    return jnp.clip(corners[best], 0.0, size)
