"""The belief on the evaluation grid as it is drawn: mean, standard deviation, and the area of high interest."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from maipp.engine.score import interest_of
from maipp.live.belief_query import believe
from maipp.live.measurements import MeasurementSet
from maipp.live.world import Setup, World
from maipp.typing import Bool, Float

_LARGEST = 100.0  # standard deviations; without a threshold every place exceeds it by more than can be drawn


class BeliefMaps(NamedTuple):
    """One value for each point of the evaluation grid."""

    mean: Float[np.ndarray, " q"]  # caller's unit
    std: Float[np.ndarray, " q"]  # caller's unit
    # Of the confidence bound over the threshold, standard deviations of the kernel; the area is where it is not below 0
    # and `inside` holds
    surplus: Float[np.ndarray, " q"]
    inside: Bool[np.ndarray, " q"]  # False: outside of the survey's area, or in a no-go zone
    measurements: int  # that count


def belief_maps(world: World, setup: Setup, measurements: MeasurementSet) -> BeliefMaps:
    """The maps of a live survey; the area is by the kernel that the measurements have been found to have."""
    units, mission = setup.units, world.mission
    mean, std = believe(mission, measurements, np.asarray(mission.grid, np.float64))
    level, scale = measurements.standard
    interest = interest_of(world.known(measurements.kernel, setup.beta_follows).mission.problem)
    standardised = jnp.asarray((mean - level) / scale), jnp.asarray((std / scale) ** 2)
    bound = np.asarray(interest.bound(*standardised), np.float64)
    return BeliefMaps(
        np.array(units.values_out(mean)),
        np.array(units.std_out(std)),
        np.clip(bound - float(interest.threshold), -_LARGEST, _LARGEST),
        np.asarray(mission.inside),
        len(measurements),
    )
