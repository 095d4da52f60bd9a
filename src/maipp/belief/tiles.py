"""Mean and variance at many points from many measurements: tile by tile, each from the measurements that tell of it."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief.kernel import Kernel
from maipp.belief.thinning import most_telling, spacing
from maipp.typing import Array, Bool, Float, Int

# Measurements that a tile is conditioned on, and those of the whole survey for each tile (errors:
# docs/evidence/speed.md). Half as many per tile are not enough where measurements are dense.
_PER_TILE = 256
_MEASUREMENTS = 80

# Part of a tile's diagonal around it that counts as near.
_MARGIN = 0.2

# Added to the noise for float32 (its rounding of a 256 x 256 factor), and where even that cannot be factored.
_NUGGETS = (1e-6, 1e-4)


class OrderedMeasurements(NamedTuple):
    """All that has been measured, with the order to thin it by."""

    x: Float[Array, "n 2"]  # measured positions, domain units
    y: Float[Array, " n"]  # measured values
    mask: Bool[Array, " n"]  # True where a slot holds a measurement
    spaced: Float[Array, " n"]  # `spacing` of the measurements, domain units
    noise: Float[Array, ""]  # noise variance
    extra_noise: Float[Array, " n"] | None = None  # what that of each measurement exceeds it by


def survey_of(
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    mask: Bool[Array, " n"],
    noise: float | Float[Array, ""],
    extra_noise: Float[Array, " n"] | None = None,
) -> OrderedMeasurements:
    """The survey with these measurements."""
    return OrderedMeasurements(x, y, mask, spacing(x, mask), jnp.asarray(noise, x.dtype), extra_noise)


def tile_index(points: Float[Array, "p 2"], side: int) -> Int[Array, "t c"]:
    """Indices of the points in each of `side * side` tiles of equally many, the last point filling up the rest."""
    count = points.shape[0]
    each = math.ceil(count / side**2)
    padded = jnp.minimum(jnp.arange(each * side**2), count - 1)
    strips = padded[jnp.argsort(points[padded, 0])].reshape(side, -1)
    order = jnp.argsort(points[strips, 1], axis=1)
    return jnp.take_along_axis(strips, order, axis=1).reshape(side**2, each)


def tile_moments(
    kernel: Kernel, survey: OrderedMeasurements, points: Float[Array, "p 2"]
) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    """Posterior mean and variance at the points, each given the measurements that tell most of its tile.

    The variance is that of a part of the measurements: never below that of all of them, but for rounding.
    """
    slots = survey.x.shape[0]
    side = max(1, math.ceil(math.sqrt(min(slots / _MEASUREMENTS, points.shape[0] / 4))))
    index = tile_index(lax.stop_gradient(points), side)
    tiles = points[index]
    mean, variance = _predict(kernel, survey, tiles, min(_PER_TILE, slots))
    flat = index.reshape(-1)
    none = jnp.zeros(points.shape[0], points.dtype)
    return none.at[flat].set(mean.reshape(-1)), none.at[flat].set(variance.reshape(-1))


def _predict(
    kernel: Kernel, survey: OrderedMeasurements, tiles: Float[Array, "t c 2"], count: int
) -> tuple[Float[Array, "t c"], Float[Array, "t c"]]:
    """Mean and variance at the points of each tile."""
    low, high = jnp.min(tiles, axis=1), jnp.max(tiles, axis=1)
    reach = _MARGIN * jnp.sqrt(jnp.sum((high - low) ** 2, axis=-1)) + 1e-3 * jnp.max(high)

    def choose(low: Array, high: Array, reach: Array) -> Int[Array, " c"]:
        return most_telling(survey.x, survey.mask, survey.spaced, low, high, reach, count)

    chosen = jax.vmap(choose)(low, high, reach)
    x, mask = survey.x[chosen], survey.mask[chosen]
    y = jnp.where(mask, survey.y[chosen], 0.0)
    prior = jnp.asarray(kernel.variance, x.dtype)
    pair = mask[:, :, None] & mask[:, None, :]
    gram = jnp.where(pair, kernel(x[:, :, None], x[:, None, :]), 0.0)
    noise = survey.noise if survey.extra_noise is None else survey.noise + survey.extra_noise[chosen]
    own = jnp.where(mask, noise, prior)
    factor = _factors(gram, own, prior)
    cross = jnp.where(mask[:, :, None], kernel(x[:, :, None], tiles[:, None, :]), 0.0)
    solved = lax.linalg.triangular_solve(
        factor, jnp.concatenate([cross, y[:, :, None]], axis=2), left_side=True, lower=True
    )
    rows, values = solved[:, :, :-1], solved[:, :, -1]
    # Where nothing could be factored the tile knows nothing.
    finite = jnp.isfinite(solved).all(axis=(1, 2))[:, None]
    variance = jnp.maximum(prior - jnp.sum(rows * rows, axis=1), 0.0)
    return jnp.where(finite, jnp.einsum("tkc,tk->tc", rows, values), 0.0), jnp.where(finite, variance, prior)


def _factors(gram: Float[Array, "t k k"], own: Float[Array, "t k"], prior: Float[Array, ""]) -> Float[Array, "t k k"]:
    """Cholesky factors of the tiles' covariances, `own` added to the diagonal and a nugget where float32 needs it."""
    diagonal = jnp.eye(gram.shape[-1], dtype=bool)
    small, large = (nugget * prior if gram.dtype == jnp.float32 else 0.0 * prior for nugget in _NUGGETS)

    def factor(nugget: Array) -> Float[Array, "t k k"]:
        covariance = jnp.where(diagonal, gram + (own + nugget)[:, :, None], gram)
        return lax.linalg.cholesky(covariance, symmetrize_input=False)  # it is symmetric

    first = factor(small)
    # What could not be factored is NaN all over, so the diagonal tells.
    fails = ~jnp.isfinite(jnp.diagonal(first, axis1=1, axis2=2)).all(axis=1)[:, None, None]
    return lax.cond(fails.any(), lambda: jnp.where(fails, factor(large), first), lambda: first)
