"""Mean and variance at many points from many measurements: tile by tile, each from the measurements that tell of it."""

import math
from functools import partial
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

    def predict(tile: Float[Array, "c 2"]) -> tuple[Float[Array, " c"], Float[Array, " c"]]:
        return _predict(kernel, survey, tile, min(_PER_TILE, slots))

    # On a CPU tile by tile, whose matrices stay in a core's cache (docs/evidence/speed.md, large teams).
    every = partial(lax.map, predict) if jax.default_backend() == "cpu" else jax.vmap(predict)
    mean, variance = every(points[index])
    # Gathered, not scattered: a CPU takes microseconds for each place that is written to. The last point may be in its
    # tile several times.
    place = jnp.argsort(index.reshape(-1))[: points.shape[0]]
    return mean.reshape(-1)[place], variance.reshape(-1)[place]


def _predict(
    kernel: Kernel, survey: OrderedMeasurements, tile: Float[Array, "c 2"], count: int
) -> tuple[Float[Array, " c"], Float[Array, " c"]]:
    """Mean and variance at the points of one tile, given `count` of the measurements."""
    low, high = jnp.min(tile, axis=0), jnp.max(tile, axis=0)
    reach = _MARGIN * jnp.sqrt(jnp.sum((high - low) ** 2)) + 1e-3 * jnp.max(high)
    chosen = most_telling(survey.x, survey.mask, survey.spaced, low, high, reach, count)
    x, mask = survey.x[chosen], survey.mask[chosen]
    y = jnp.where(mask, survey.y[chosen], 0.0)
    prior = jnp.asarray(kernel.variance, x.dtype)
    noise = survey.noise if survey.extra_noise is None else survey.noise + survey.extra_noise[chosen]
    own = jnp.where(mask, noise, prior)
    gram = jnp.where(mask[:, None] & mask[None, :], kernel.matrix(x, x), 0.0)
    gram = jnp.where(jnp.eye(count, dtype=bool), gram + own[:, None], gram)
    cross = jnp.where(mask[:, None], kernel.matrix(x, tile), 0.0)
    solved = _whitened(gram, jnp.concatenate([cross, y[:, None]], axis=1), prior)
    rows, values = solved[:, :-1], solved[:, -1]
    # Where nothing could be factored the tile knows nothing.
    finite = jnp.isfinite(solved).all()
    variance = jnp.maximum(prior - jnp.sum(rows * rows, axis=0), 0.0)
    return jnp.where(finite, values @ rows, 0.0), jnp.where(finite, variance, prior)


def _solve(covariance: Float[Array, "k k"], right: Float[Array, "k c"], nugget: Float[Array, ""]) -> Array:
    """L^-1 right, L the Cholesky factor of the covariance plus a nugget; NaN where there is none."""
    diagonal = jnp.eye(covariance.shape[0], dtype=bool)
    raised = jnp.where(diagonal, covariance + nugget, covariance)
    factor = lax.linalg.cholesky(raised, symmetrize_input=False)  # it is symmetric
    return lax.linalg.triangular_solve(factor, right, left_side=True, lower=True)


def _with_nugget(
    covariance: Float[Array, "k k"], right: Float[Array, "k c"], prior: Float[Array, ""]
) -> tuple[Float[Array, "k c"], Float[Array, ""]]:
    """`_solve` with the small nugget, or with the large one where float32 needs it; and the nugget."""
    small, large = (nugget * prior if covariance.dtype == jnp.float32 else 0.0 * prior for nugget in _NUGGETS)

    def fails(tried: tuple[Array, Array]) -> Bool[Array, ""]:
        solved, nugget = tried
        return (nugget < large) & ~jnp.isfinite(solved).all()

    def again(tried: tuple[Array, Array]) -> tuple[Array, Array]:
        nugget = jnp.maximum(tried[1], large)  # of the carry: a constant would have XLA solve it before the loop
        return _solve(covariance, right, nugget), nugget

    # What is carried is the solution and not the factor, which the loop would have copied to a layout of its own.
    return lax.while_loop(fails, again, (_solve(covariance, right, small), small))


@jax.custom_jvp
def _whitened(
    covariance: Float[Array, "k k"], right: Float[Array, "k c"], prior: Float[Array, ""]
) -> Float[Array, "k c"]:
    """L^-1 right, with L L^T the covariance and the nugget that it needs."""
    return _with_nugget(covariance, right, prior)[0]


@_whitened.defjvp
def _(primals: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[Array, Array]:
    """The derivative at the nugget that was found: no loop is differentiated."""
    nugget = _with_nugget(*lax.stop_gradient(primals))[1]
    return jax.jvp(lambda covariance, right: _solve(covariance, right, nugget), primals[:2], tangents[:2])
