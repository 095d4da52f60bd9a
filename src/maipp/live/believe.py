"""The belief from all measurements so far, asked at any points."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import condition_near
from maipp.engine.observe import window_reach
from maipp.live.measurements import Slots, slots_for
from maipp.live.world import World
from maipp.typing import Array, Bool, Float

# Fewest points that are asked together; other numbers are filled up to a power of two, each a shape to compile for.
_FEWEST = 64


@eqx.filter_jit
def _moments(
    world: World, x: Float[Array, "n 2"], y: Float[Array, " n"], mask: Bool[Array, " n"], points: Float[Array, "p 2"]
) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    scenario = world.scenario
    belief = condition_near(
        world.kernel,
        x,
        y,
        mask,
        points,
        scenario.noise,
        world.extra_noise(len(y)),
        near=jnp.asarray(scenario.extent, x.dtype) / 2,
        reach=window_reach(scenario),
        capacity=scenario.belief_capacity,
    )
    return belief.mean, belief.std


def believe(
    world: World, slots: Slots, points: Float[np.ndarray, "p 2"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Mean and standard deviation at domain positions, standardised values: a function of the measurements alone."""
    count = len(points)
    filled = np.minimum(np.arange(slots_for(count, _FEWEST)), count - 1)
    x, y, mask, asked = jax.device_put((*slots, points.astype(slots.x.dtype)[filled]))
    mean, std = jax.device_get(_moments(world, x, y, mask, asked))
    return mean[:count], std[:count]
