"""How far a straight leg goes before it would enter a no-go zone."""

import jax.numpy as jnp
from jax import lax

from maipp.roadmap.zones import Borders
from maipp.typing import Array, Bool, Float

# Positions are right to this part of the margin: what rounding may put beyond a line, or beside the end of an edge.
_ROUNDING = 0.02


def collision_free_share(
    borders: Borders, start: Float[Array, "*#c 2"], end: Float[Array, "*#c 2"]
) -> Float[Array, "*c"]:
    """The part in [0, 1] of each straight leg that keeps out of the zones, to a margin before the edge that it meets.

    An edge stops only what comes from its free side, so whoever stands within the clearance of a zone, or has drifted
    into it, may leave. No slope passes.
    """
    start, end = lax.stop_gradient((start, end))
    x, y = start[..., 0, None] - borders.begin[:, 0], start[..., 1, None] - borders.begin[:, 1]
    dx, dy = (end - start)[..., 0, None], (end - start)[..., 1, None]
    ax, ay = borders.along[:, 0], borders.along[:, 1]
    height, ahead = ax * y - ay * x, ax * x + ay * y  # above the line through the edge, on its free side; along it
    fall, advance = ay * dx - ax * dy, ax * dx + ay * dy
    per_fall = 1.0 / jnp.maximum(fall, 1e-12)
    margin, rounding = borders.margin, _ROUNDING * borders.margin
    # Within the margin of the line the leg is between these two shares of it.
    first = jnp.clip((height - margin) * per_fall, 0.0, 1.0)
    last = jnp.where(fall > 0.0, jnp.clip(height * per_fall, 0.0, 1.0), 1.0)
    one, other = ahead + first * advance, ahead + last * advance
    beside = (jnp.maximum(one, other) < -rounding) | (jnp.minimum(one, other) > borders.length + rounding)
    # From a sharp corner past the end of an edge: if that leads into the zone, the other edge of the corner stops it.
    leaves = (ahead < rounding) & (advance < 0.0) & borders.sharp[:, 0]
    leaves |= (ahead > borders.length - rounding) & (advance > 0.0) & borders.sharp[:, 1]
    # Along the line itself, rounding may hide a fall.
    falls = fall > jnp.where(height < rounding, -0.5 * rounding, 0.0)
    meets = falls & (height >= -rounding) & (height - fall < margin) & ~beside & ~leaves
    return jnp.min(jnp.where(meets, first, 1.0), axis=-1)


def is_collision_free(borders: Borders, start: Float[Array, "*#c 2"], end: Float[Array, "*#c 2"]) -> Bool[Array, "*c"]:
    """Whether each straight leg keeps out of the zones all the way."""
    return collision_free_share(borders, start, end) >= 1.0


def cut(borders: Borders, start: Float[Array, "*#c 2"], end: Float[Array, "*#c 2"]) -> Float[Array, "*c 2"]:
    """Where each straight leg ends that goes on only while it keeps out of the borders."""
    share = collision_free_share(borders, start, end)[..., None]
    # The end of a free leg is that point exactly.
    return jnp.where(share < 1.0, start + share * (end - start), end)
