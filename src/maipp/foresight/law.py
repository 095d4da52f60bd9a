"""What is foreseen of the field at given points."""

from typing import NamedTuple

import jax.numpy as jnp
from jax.scipy.special import ndtr

from maipp.typing import Array, Float, Int, Real

# Least deviation counted on, in units of the field: the slope of a probability is finite with it.
_LEAST = 1e-4


class Law(NamedTuple):
    """Mean and standard deviation of the true field at each point, without the noise of a measurement; field units."""

    mean: Float[Array, "*b q"]
    deviation: Float[Array, "*b q"]  # >= 0

    def above(self, threshold: Real) -> Float[Array, "*b q"]:
        """The probability that the field reaches the threshold at each point, as if it were normal."""
        return ndtr((self.mean - threshold) / jnp.sqrt(self.deviation**2 + _LEAST**2))

    def pick(self, index: Int[Array, " i"]) -> "Law":
        """The law at some of its points."""
        return Law(self.mean[..., index], self.deviation[..., index])
