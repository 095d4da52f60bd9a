"""Plans as headings: legs of fixed length, each in a direction of its own, that never leave the domain."""

import jax.numpy as jnp

from maipp.typing import Array, Float


def walk(
    start: Float[Array, "*#c 2"], headings: Float[Array, "*c h"], steps: Float[Array, " h"], extent: tuple[float, float]
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


def _leg(x: Array, y: Array, dx: Array, dy: Array, step: Array, extent: tuple[float, float]) -> tuple[Array, Array]:
    """End of one leg, turned where it would leave the domain."""
    width, height = extent
    inside_x = jnp.clip(x + dx, 0.0, width)
    moved = inside_x - x
    turned = inside_x != x + dx
    # What the border takes from x goes to y, towards the side with more room where the leg was straight at the border.
    rest = jnp.sqrt(jnp.maximum(step * step - moved * moved, 1e-12))
    sideways = jnp.where(turned, jnp.where(dy >= 0, rest, -rest), dy)
    sideways = jnp.where(
        (y + sideways > height) | (y + sideways < 0.0), jnp.where(turned, -sideways, sideways), sideways
    )
    inside_y = jnp.clip(y + sideways, 0.0, height)
    moved_y = inside_y - y
    turned_y = inside_y != y + sideways
    rest_x = jnp.sqrt(jnp.maximum(step * step - moved_y * moved_y, 1e-12))
    across = jnp.where(turned_y & ~turned, jnp.where(dx >= 0, rest_x, -rest_x), moved)
    across = jnp.where((x + across > width) | (x + across < 0.0), -across, across)
    return jnp.clip(x + across, 0.0, width), inside_y
