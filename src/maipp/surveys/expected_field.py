"""The field that the samples lead to expect: the posterior mean of the prior."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from maipp.belief import Matern32
from maipp.scenario import Scenario
from maipp.typing import Array, Float

_SQRT3 = 3.0**0.5


class ExpectedField(eqx.Module):
    """The posterior mean as a callable from domain points to standardised values; 0 everywhere without samples."""

    x: Float[Array, "p 2"]  # samples, domain units
    weights: Float[Array, " p"]  # (K + s^2 I)^-1 y
    kernel: Matern32

    @classmethod
    def of(
        cls, scenario: Scenario, x: Float[np.ndarray, "p 2"], y: Float[np.ndarray, " p"], *, noise: float
    ) -> "ExpectedField":
        """The mean after samples `y` at `x` (domain units, standardised; noise variance), solved in float64."""
        if len(y):
            gram = _matern(np.linalg.norm(x[:, None] - x[None], axis=-1), scenario)
            factor = cho_factor(gram + noise * np.eye(len(y)), lower=True)
            weights = cho_solve(factor, y)
        else:  # one without weight: batches take no arrays without elements
            x, weights = np.zeros((1, 2)), np.zeros(1)
        real = jnp.result_type(float)
        kernel = Matern32(scenario.length_scale, scenario.signal_variance)
        return cls(jax.device_put(x.astype(real)), jax.device_put(weights.astype(real)), kernel)

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Expected values at domain positions."""
        return self.kernel.matrix(points, self.x) @ self.weights


def _matern(distance: np.ndarray, scenario: Scenario) -> np.ndarray:
    scaled = distance * (_SQRT3 / scenario.length_scale)
    return scenario.signal_variance * (1.0 + scaled) * np.exp(-scaled)
