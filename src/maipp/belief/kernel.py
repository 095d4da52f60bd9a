"""Covariance functions of the Gaussian-process prior."""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from maipp.typing import Array, Float


class Kernel(eqx.Module):
    """A stationary covariance `variance * correlation(r)`, r the distance in units of `length_scale / stretch`."""

    length_scale: float | Float[Array, ""]  # domain units
    variance: float | Float[Array, ""] = 1.0  # prior variance of the field, squared field units
    # Symmetric, of determinant 1: takes offsets to where the field is alike in all directions. None: it is.
    warp: Float[Array, "2 2"] | None = None

    stretch: ClassVar[float] = 1.0

    @staticmethod
    @abstractmethod
    def correlation(distance: Float[Array, "..."], variance: Any = 1.0) -> Float[Array, "..."]:
        """Correlation of two points by their distance r, 1 at 0; times the variance."""

    @staticmethod
    @abstractmethod
    def fall(distance: Float[Array, "..."]) -> Float[Array, "..."]:
        """What the correlation falls by with r, divided by r: -correlation'(r) / r; finite everywhere."""

    def scaled(self, offset: Float[Array, "*o 2"]) -> Float[Array, "*o 2"]:
        """Offsets that are warped already in the units of r."""
        return offset * (self.stretch / jnp.asarray(self.length_scale, offset.dtype))

    def __call__(self, a: Float[Array, "*a 2"], b: Float[Array, "*b 2"]) -> Float[Array, "..."]:
        """Covariance between points of `a` and `b`; leading axes broadcast, so `a[:, None], b` gives a matrix."""
        return self.correlation(self.distance(a, b), self.variance)

    def distance(self, a: Float[Array, "*a 2"], b: Float[Array, "*b 2"]) -> Float[Array, "..."]:
        """The distance r between points of `a` and `b`; leading axes broadcast."""
        scaled = self.scaled(a - b if self.warp is None else (a - b) @ self.warp)
        squared = scaled[..., 0] * scaled[..., 0] + scaled[..., 1] * scaled[..., 1]
        # sqrt has an infinite slope at zero; the gradient that passes there is 0.
        # `!=` and not `>`: a place of NaN must not pass for the same place as every other.
        apart = squared != 0
        return jnp.where(apart, jnp.sqrt(jnp.where(apart, squared, 1.0)), 0.0)

    def matrix(self, a: Float[Array, "n 2"], b: Float[Array, "q 2"]) -> Float[Array, "n q"]:
        """Covariance matrix between two point sets."""
        return self(a[:, None, :], b[None, :, :])


class Matern12(Kernel):
    """Matern 1/2, the exponential: continuous fields without slopes."""

    @staticmethod
    def correlation(distance: Float[Array, "..."], variance: Any = 1.0) -> Float[Array, "..."]:
        """exp(-r)."""
        return variance * jnp.exp(-distance)

    @staticmethod
    def fall(distance: Float[Array, "..."]) -> Float[Array, "..."]:
        """exp(-r) / r; 0 at 0, where the covariance has a tip and no slope."""
        apart = distance > 0
        return jnp.where(apart, jnp.exp(-distance) / jnp.where(apart, distance, 1.0), 0.0)


class Matern32(Kernel):
    """Matern 3/2 covariance `variance * (1 + sqrt(3) r / l) exp(-sqrt(3) r / l)` (Yang et al. 2023, Sec. III-A)."""

    stretch = 3.0**0.5

    @staticmethod
    def correlation(distance: Float[Array, "..."], variance: Any = 1.0) -> Float[Array, "..."]:
        """(1 + r) exp(-r)."""
        return variance * (1.0 + distance) * jnp.exp(-distance)

    @staticmethod
    def fall(distance: Float[Array, "..."]) -> Float[Array, "..."]:
        """exp(-r)."""
        return jnp.exp(-distance)


class Matern52(Kernel):
    """Matern 5/2: fields that bend smoothly."""

    stretch = 5.0**0.5

    @staticmethod
    def correlation(distance: Float[Array, "..."], variance: Any = 1.0) -> Float[Array, "..."]:
        """(1 + r + r^2 / 3) exp(-r)."""
        return variance * (1.0 + distance + distance * distance / 3.0) * jnp.exp(-distance)

    @staticmethod
    def fall(distance: Float[Array, "..."]) -> Float[Array, "..."]:
        """(1 + r) exp(-r) / 3."""
        return (1.0 + distance) * jnp.exp(-distance) / 3.0


class SquaredExponential(Kernel):
    """The squared exponential (RBF, Gaussian): fields without any roughness."""

    @staticmethod
    def correlation(distance: Float[Array, "..."], variance: Any = 1.0) -> Float[Array, "..."]:
        """exp(-r^2 / 2)."""
        return variance * jnp.exp(-0.5 * distance * distance)

    @staticmethod
    def fall(distance: Float[Array, "..."]) -> Float[Array, "..."]:
        """exp(-r^2 / 2)."""
        return jnp.exp(-0.5 * distance * distance)


# By the name that a scenario gives.
KERNELS: dict[str, type[Kernel]] = {
    "matern12": Matern12,
    "matern32": Matern32,
    "matern52": Matern52,
    "squared-exponential": SquaredExponential,
}
