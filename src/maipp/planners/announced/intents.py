"""The others' intents as measurements to be expected: what a team member may count on."""

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.planners.announced.announced_measurements import count_announced
from maipp.team.intent import Intent, is_announced
from maipp.typing import Array, Bool, Float, Point

# Three equal weights at -s, 0, s standard deviations have unit variance at s = sqrt(3/2).
_SPREAD = 1.5**0.5


def intent_points(intent: Intent) -> Float[Array, "*b 3 2"]:
    """Three points with the mean of the intent and its variance along its longer axis (domain units)."""
    xx, xy, yy = jnp.moveaxis(intent.covariance, -1, 0)
    half = (xx - yy) / 2
    angle = 0.5 * jnp.arctan2(xy, half)
    length = jnp.sqrt((xx + yy) / 2 + jnp.sqrt(half * half + xy * xy))
    axis = length[..., None] * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
    return intent.mean[..., None, :] + _SPREAD * jnp.array([-1.0, 0.0, 1.0])[:, None] * axis[..., None, :]


def with_intents(
    belief: Belief, intents: Intent, heard: Bool[Array, " m"], virtual_value: str, near: Point | None = None
) -> Belief:
    """The belief with three virtual measurements where each agent that is heard and told intends to be.

    `intents` has a leading axis m. Of very many, those nearest to `near` count, if it is given.
    """
    counts = heard & is_announced(intents)
    points = jnp.where(counts[:, None, None], intent_points(intents), 0.0)
    told = jnp.repeat(counts, points.shape[1])
    return count_announced(belief, points.reshape(-1, 2), told, near=near, virtual_value=virtual_value)
