"""The belief from all measurements so far, asked at any points."""

import jax
import numpy as np

from maipp.engine import Mission
from maipp.engine.observe import belief_near, with_prior
from maipp.foresight import Foresight
from maipp.kept import kept
from maipp.live.kernel import under
from maipp.live.measurements import MeasurementSet, Slots
from maipp.typing import Array, Bool, Float

# Fewest points that are asked together; other numbers are filled up to a power of two, each a shape to compile for.
_FEWEST = 64


@kept
def _moments(
    mission: Mission,
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    mask: Bool[Array, " n"],
    points: Float[Array, "p 2"],
    foresight: Foresight | None,
) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    known, middle = with_prior(mission, x, y, mask), mission.params.extent / 2
    if foresight is None:
        belief = belief_near(mission, known, points, middle)
        return belief.mean, belief.std
    law = foresight.on(mission.problem).at(belief_near(mission, known, mission.grid, middle), points)
    return law.mean, law.deviation


def moments(
    mission: Mission, slots: Slots, points: Float[np.ndarray, "p 2"], foresight: Foresight | None = None
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Mean and standard deviation at domain positions, by the mission's kernel and in its standardised values.

    With a foresight those that it expects of the true field.
    """
    count = len(points)
    filled = np.minimum(np.arange(1 << max(count - 1, _FEWEST - 1).bit_length()), count - 1)
    x, y, mask, asked = jax.device_put((slots.x, slots.y, slots.mask, points.astype(slots.x.dtype)[filled]))
    mean, std = jax.device_get(_moments(mission, x, y, mask, asked, foresight))
    return mean[:count], std[:count]


def believe(
    mission: Mission,
    measurements: MeasurementSet,
    points: Float[np.ndarray, "p 2"],
    foresight: Foresight | None = None,
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Mean and standard deviation at domain positions, the mission's standardised values, by the kernel that the
    measurements have been found to have: a function of them alone. With a foresight those that it expects."""
    kernel, slots = measurements.kernel, measurements.slots()
    if kernel is None:
        return moments(mission, slots, points, foresight)
    level, scale = (np.array(number, slots.y.dtype) for number in measurements.standard)
    mean, std = moments(under(mission, measurements.guess, kernel), slots, points, foresight)
    return mean * scale + level, std * scale
