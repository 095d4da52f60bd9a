"""Covariance functions of the Gaussian-process prior."""

import equinox as eqx
import jax.numpy as jnp

from maipp.typing import Array, Float

_SQRT3 = 3.0**0.5


class Matern32(eqx.Module):
    """Matern 3/2 covariance `variance * (1 + sqrt(3) r / l) exp(-sqrt(3) r / l)` (Yang et al. 2023, Sec. III-A)."""

    length_scale: float | Float[Array, ""]  # domain units
    variance: float | Float[Array, ""] = 1.0  # prior variance of the field, squared field units
    # Symmetric, of determinant 1: takes offsets to where the field is alike in all directions. None: it is.
    warp: Float[Array, "2 2"] | None = None

    def __call__(self, a: Float[Array, "*a 2"], b: Float[Array, "*b 2"]) -> Float[Array, "..."]:
        """Covariance between points of `a` and `b`; leading axes broadcast, so `a[:, None], b` gives a matrix."""
        offset = a - b if self.warp is None else (a - b) @ self.warp
        scaled = offset * (_SQRT3 / jnp.asarray(self.length_scale, a.dtype))
        squared = scaled[..., 0] * scaled[..., 0] + scaled[..., 1] * scaled[..., 1]
        # sqrt has an infinite slope at zero; the covariance there is flat, so the gradient that passes is 0.
        # `!=` and not `>`: a place of NaN must not pass for the same place as every other.
        apart = squared != 0
        distance = jnp.where(apart, jnp.sqrt(jnp.where(apart, squared, 1.0)), 0.0)
        return self.variance * (1.0 + distance) * jnp.exp(-distance)

    def matrix(self, a: Float[Array, "n 2"], b: Float[Array, "q 2"]) -> Float[Array, "n q"]:
        """Covariance matrix between two point sets."""
        return self(a[:, None, :], b[None, :, :])
