"""The belief from all measurements so far, asked at any points."""

import equinox as eqx
import jax
import numpy as np

from maipp.engine import Mission
from maipp.engine.observe import belief_near, with_prior
from maipp.live.measurements import Measurements
from maipp.live.world import World
from maipp.typing import Array, Bool, Float

# Fewest points that are asked together; other numbers are filled up to a power of two, each a shape to compile for.
_FEWEST = 64


@eqx.filter_jit
def _moments(
    mission: Mission,
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    mask: Bool[Array, " n"],
    points: Float[Array, "p 2"],
) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    belief = belief_near(mission, with_prior(mission, x, y, mask), points, mission.params.extent / 2)
    return belief.mean, belief.std


def known(world: World, measurements: Measurements) -> World:
    """The world under the kernel that the measurements have been found to have."""
    kernel = measurements.kernel
    return world if kernel is None else world.under(kernel)


def believe(
    world: World, measurements: Measurements, points: Float[np.ndarray, "p 2"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Mean and standard deviation at domain positions, the mission's standardised values: a function of the
    measurements alone."""
    slots, (level, scale) = measurements.slots(), measurements.standard
    count = len(points)
    filled = np.minimum(np.arange(1 << max(count - 1, _FEWEST - 1).bit_length()), count - 1)
    x, y, mask, asked = jax.device_put((slots.x, slots.y, slots.mask, points.astype(slots.x.dtype)[filled]))
    mean, std = jax.device_get(_moments(known(world, measurements).mission, x, y, mask, asked))
    if measurements.kernel is None:
        return mean[:count], std[:count]
    return mean[:count] * np.float32(scale) + np.float32(level), std[:count] * np.float32(scale)
