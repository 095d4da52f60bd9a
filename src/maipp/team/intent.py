"""The Gaussian intent: where an agent expects to be, fitted, told to others and fused into one map."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.renamed import renamed
from maipp.typing import Array, Bool, Float

# Least variance of an intent along any direction, squared domain units, for a domain about 1 across. Scale it with the
# square of the extent: a floor far below the domain's size leaves float32 no digits for the narrow direction.
COVARIANCE_FLOOR = (1 / 28) ** 2


class Intent(NamedTuple):
    """Gaussian over the future positions of one agent: the five numbers it broadcasts (Yang et al. 2023, Sec. IV-B).

    Both fields may have leading axes, such as one over agents. All five are NaN while nothing has been told.
    """

    mean: Float[Array, "*b 2"]  # domain units
    covariance: Float[Array, "*b 3"]  # xx, xy, yy; squared domain units


def no_intent() -> Intent:
    """The intent of an agent that has told nothing yet."""
    real = jnp.result_type(float)
    return Intent(jnp.full(2, jnp.nan, real), jnp.full(3, jnp.nan, real))


def is_announced(intent: Intent) -> Bool[Array, "*b"]:
    """Whether the intent says anything: true where all its numbers are finite."""
    return jnp.isfinite(intent.mean).all(axis=-1) & jnp.isfinite(intent.covariance).all(axis=-1)


def matrix(intent: Intent) -> Float[Array, "*b 2 2"]:
    """Covariance as a symmetric matrix, squared domain units."""
    xx, xy, yy = jnp.moveaxis(intent.covariance, -1, 0)
    return jnp.stack([jnp.stack([xx, xy], axis=-1), jnp.stack([xy, yy], axis=-1)], axis=-2)


def fit_intent(
    points: Float[Array, "p 2"], mask: Bool[Array, " p"], floor: float | Float[Array, ""] = COVARIANCE_FLOOR
) -> Intent:
    """Maximum-likelihood Gaussian of the masked points (Yang et al. 2023, Sec. IV-B), with a least covariance.

    `floor` bounds both eigenvalues from below, squared domain units. One point alone has the covariance `floor * I`;
    no point at all gives `no_intent()`.
    """
    count = jnp.sum(mask, dtype=points.dtype)
    divisor = jnp.maximum(count, 1.0)
    # Masked points may hold anything, NaN included: replaced before any arithmetic, they spoil no gradient either.
    mean = jnp.sum(jnp.where(mask[:, None], points, 0.0), axis=0) / divisor
    x, y = jnp.where(mask[:, None], points - mean, 0.0).T
    moments = jnp.stack([jnp.sum(x * x), jnp.sum(x * y), jnp.sum(y * y)]) / divisor
    covariance = _raise_eigenvalues(moments, floor)
    some = count > 0
    return Intent(jnp.where(some, mean, jnp.nan), jnp.where(some, covariance, jnp.nan))


def _raise_eigenvalues(covariance: Float[Array, "3"], floor: float | Float[Array, ""]) -> Float[Array, "3"]:
    """The covariance whose eigenvalues are the larger of its own and `floor`, with the same eigenvectors.

    A floor on the two variances alone would not do: points along a diagonal have large variances in x and in y, and a
    singular covariance.
    """
    floor = jnp.asarray(floor, covariance.dtype)
    xx, xy, yy = covariance
    middle, half = (xx + yy) / 2, (xx - yy) / 2
    squared = half * half + xy * xy
    # The covariance is middle * I + radius * R with R a reflection that has no direction, and its root no slope, where
    # the eigenvalues coincide. Below float precision of the floor nothing is lost by leaving it out.
    directed = squared > (jnp.finfo(covariance.dtype).eps * floor) ** 2
    radius = jnp.sqrt(jnp.where(directed, squared, 1.0))
    spread = jnp.where(directed, radius, 0.0)
    large, small = jnp.maximum(middle + spread, floor), jnp.maximum(middle - spread, floor)
    scale = jnp.where(directed, (large - small) / (2 * radius), 0.0)
    raised = (large + small) / 2
    return jnp.stack([raised + scale * half, scale * xy, raised - scale * half])


def destination_intent(
    trajectories: Float[Array, "a j 2"],
    mask: Bool[Array, "a j"],
    floor: float | Float[Array, ""] = COVARIANCE_FLOOR,
) -> Intent:
    """Intent over the last valid node of each sampled trajectory (DI, Yang et al. 2023, Sec. V).

    Trajectories without a valid node count for nothing. `floor` as in `fit_intent`.
    """
    steps = jnp.arange(mask.shape[1])
    last = jnp.max(jnp.where(mask, steps, 0), axis=1)
    ends = jnp.take_along_axis(trajectories, last[:, None, None], axis=1)[:, 0]
    return fit_intent(ends, mask.any(axis=1), floor)


def trajectory_intent(
    trajectories: Float[Array, "a j 2"],
    mask: Bool[Array, "a j"],
    floor: float | Float[Array, ""] = COVARIANCE_FLOOR,
) -> Intent:
    """Intent over all valid nodes of all sampled trajectories (TI, Yang et al. 2023, Sec. V).

    A node visited by several trajectories counts once for each. `floor` as in `fit_intent`.
    """
    return fit_intent(trajectories.reshape(-1, 2), mask.reshape(-1), floor)


def intent_density(intent: Intent, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
    """Density of one intent at the points, 1 / squared domain units; zero where nothing has been told."""
    return jnp.where(is_announced(intent), jnp.exp(_log_density(intent, points)), 0.0)


def fuse_intents(intents: Intent, heard: Bool[Array, " m"], points: Float[Array, "n 2"]) -> Float[Array, " n"]:
    """Accumulated intent map: summed densities of the agents that are heard and told, divided by their maximum.

    `intents` has a leading axis m. The map lies in [0, 1] and is exactly 1 at its highest point, however far all points
    are from every mean; it is zero everywhere where nobody counts (Yang et al. 2023, Sec. IV-B).
    """
    counts = heard & is_announced(intents)
    logs = jnp.where(counts[:, None], jax.vmap(_log_density, (0, None))(intents, points), -jnp.inf)
    someone = counts.any()
    # Far from every mean all densities underflow. Relative to the largest one only those underflow that add nothing to
    # the sum anyway. The shift cancels in the quotient, so no gradient needs to pass through it.
    shift = jax.lax.stop_gradient(jnp.where(someone, jnp.max(logs), 0.0))
    total = jnp.sum(jnp.where(counts[:, None], jnp.exp(logs - shift), 0.0), axis=0)
    # Compilers may divide by multiplying with a reciprocal, which misses 1 by a digit on either side.
    highest = (jnp.arange(points.shape[0]) == jnp.argmax(total)) & someone
    return jnp.where(highest, 1.0, jnp.minimum(total / jnp.where(someone, jnp.max(total), 1.0), 1.0))


def symmetric_kl(a: Intent, b: Intent) -> Float[Array, ""]:
    """Symmetric Kullback-Leibler divergence `KL(a || b) + KL(b || a)` between two intents, nats.

    Never negative, and NaN where either has told nothing.
    """
    # The log determinants of the two directions cancel, and tr(A^-1 B) + tr(B^-1 A) - 4 = |L_A^-1 (B - A) L_B^-T|^2
    # with A = L_A L_A^T, B = L_B L_B^T: a sum of squares keeps all digits where the two intents are close.
    crossed = _whiten(b, _whiten(a, matrix(b) - matrix(a)).T)
    moved = b.mean - a.mean
    return 0.5 * (jnp.sum(crossed**2) + jnp.sum(_whiten(a, moved) ** 2) + jnp.sum(_whiten(b, moved) ** 2))


def _log_density(intent: Intent, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
    """Logarithm of the density at the points; that of a standard normal, to be masked, where nothing has been told."""
    told = is_announced(intent)
    unit = jnp.array([1.0, 0.0, 1.0], intent.covariance.dtype)
    intent = Intent(jnp.where(told, intent.mean, 0.0), jnp.where(told, intent.covariance, unit))
    root, _, rest = _factor(intent)
    whitened = _whiten(intent, points - intent.mean)
    return -0.5 * jnp.sum(whitened**2, axis=-1) - jnp.log(2 * math.pi * root * rest)


def _factor(intent: Intent) -> tuple[Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """Entries 11, 21 and 22 of the Cholesky factor of the covariance."""
    xx, xy, yy = intent.covariance
    root = jnp.sqrt(xx)
    slope = xy / root
    return root, slope, jnp.sqrt(yy - slope * slope)


def _whiten(intent: Intent, offsets: Float[Array, "*n 2"]) -> Float[Array, "*n 2"]:
    """Offsets in units of the intent's own spread: `L^-1 v` with `L L^T` its covariance."""
    root, slope, rest = _factor(intent)
    x = offsets[..., 0] / root
    return jnp.stack([x, (offsets[..., 1] - slope * x) / rest], axis=-1)


renamed(__name__, is_told="is_announced")
