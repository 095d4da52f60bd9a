"""The paper's ground truth: sums of axis-aligned Gaussians, normalised over the evaluation grid."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.kept import kept
from maipp.typing import Array, Bool, Extent, Float, Key


def evaluation_grid(points_per_side: int = 30, extent: Extent = (1.0, 1.0)) -> Float[Array, "q 2"]:
    """The evaluation grid, both ends included, x slowest: row `ix * points_per_side + iy` (domain units)."""
    x, y = (jnp.linspace(0.0, side, points_per_side) for side in extent)
    return jnp.stack(jnp.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


@kept
def _grid(points_per_side: int, extent: Float[Array, "2"]) -> Float[Array, "q 2"]:
    return evaluation_grid(points_per_side, extent)


def host_grid(points_per_side: int, extent: tuple[float, float]) -> Float[np.ndarray, "q 2"]:
    """The same on the host, in float64: the numbers that it has at JAX's precision."""
    return np.asarray(_grid(points_per_side, np.asarray(extent, jnp.result_type(float))), np.float64)


class GaussianMixture(eqx.Module):
    """Sum of K bumps `exp(-(dx^2 / s_x + dy^2 / s_y) / 2) / (2 pi s_x s_y)`, divided by its maximum over the grid.

    `s` acts as a variance and the prefactor is that of the public code family (docs/protocol.md).
    """

    mean: Float[Array, "k 2"]  # centres, domain units
    sigma: Float[Array, "k 2"]  # variances s along x and y, squared domain units
    present: Bool[Array, " k"]  # False pads mixtures of fewer than k bumps
    maximum: Float[Array, ""]  # largest unnormalised value on the evaluation grid

    def __init__(
        self,
        mean: Float[Array, "k 2"],
        sigma: Float[Array, "k 2"],
        *,
        present: Bool[Array, " k"] | None = None,
        grid: Float[Array, "q 2"] | None = None,
    ) -> None:
        self.mean = jnp.asarray(mean, jnp.result_type(float))
        self.sigma = jnp.asarray(sigma, jnp.result_type(float))
        self.present = jnp.ones(self.mean.shape[0], bool) if present is None else present
        self.maximum = jnp.ones((), self.mean.dtype)
        self.maximum = jnp.max(self(evaluation_grid() if grid is None else grid))

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Normalised field values at the points."""
        delta = jnp.asarray(points)[:, None, :] - self.mean
        exponent = -0.5 * jnp.sum(delta * delta / self.sigma, axis=-1)
        weight = jnp.where(self.present, 1.0 / (2.0 * jnp.pi * jnp.prod(self.sigma, axis=-1)), 0.0)
        return jnp.exp(exponent) @ weight / self.maximum


def sample_mixture(
    key: Key,
    *,
    components: tuple[int, int] = (8, 12),
    variance: tuple[float, float] | Float[Array, "2"] = (5e-5, 2e-4),
    extent: Extent = (1.0, 1.0),
    grid: Float[Array, "q 2"],
) -> GaussianMixture:
    """A random mixture: a uniform number of bumps, uniform centres, `s = sqrt(U(variance))` (docs/protocol.md)."""
    count_key, mean_key, sigma_key = jax.random.split(key, 3)
    low, high = components
    count = jax.random.randint(count_key, (), low, high + 1)
    mean = jax.random.uniform(mean_key, (high, 2)) * jnp.asarray(extent)
    sigma = jnp.sqrt(jax.random.uniform(sigma_key, (high, 2), minval=variance[0], maxval=variance[1]))
    return GaussianMixture(mean, sigma, present=jnp.arange(high) < count, grid=grid)
