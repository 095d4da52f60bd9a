"""The foresight that foresees nothing: what plans count on of the protocol's belief itself."""

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.foresight.foresight import Foresight
from maipp.foresight.law import Law
from maipp.problem import ScenarioLike
from maipp.typing import Real

# The spread trusted, and the length scale, in measurement intervals, below which it falls with the square of that.
_SPREAD, _RESOLVED = 0.3, 2.0


def trusted_spread(scenario: ScenarioLike) -> Real:
    """How far the field is from the belief's mean, in units of the belief's deviation, as plans count on it."""
    resolved = scenario.length_scale / (_RESOLVED * scenario.measurement_interval)
    return _SPREAD * jnp.minimum(1.0, resolved) ** 2


class ProtocolForesight(Foresight):
    """The belief's mean, and the part of its deviation that plans trust."""

    def __call__(self, belief: Belief) -> Law:
        """The law on the evaluation grid."""
        return Law(belief.mean, trusted_spread(self.scenario) * belief.std)
