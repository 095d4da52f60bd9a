"""The variance that plans leave, and how it changes with where they measure.

Searches follow that slope hundreds of times a decision, so it is written out here: what automatic differentiation
gives, without the many small passes that it takes backwards through the factor of each plan's covariance.

With R the residual covariance between a plan's measurements and the query points, W the plan's whitened rows and
C = K(P, P) - W W^T their own covariance, the variance falls by diag(R^T C^-1 R). With A = C^-1 R and a weight g for
every query point, the slope of the weighted fall is 2 g A in R and -A g A^T in C.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, Kernel
from maipp.planners.lookahead import virtual_measurements
from maipp.typing import Array, Bool, Float


@jax.custom_vjp
def variance_left(belief: Belief, points: Float[Array, "c h 2"], taken: Bool[Array, "c h"]) -> Float[Array, "c q"]:
    """Variance at the query points after each plan's measurements; differentiable in the points alone.

    The same as `lookahead.predicted_variance`, measurements that are not `taken` add nothing.
    """
    return _forward(belief, points, taken)[0]


class _Residuals(NamedTuple):
    """What the way back needs."""

    belief: Belief
    points: Float[Array, "c h 2"]
    whitened: Float[Array, "c h n"]  # W
    solved: Float[Array, "c h q"]  # A
    left: Float[Array, "c q"]  # the variance before it is kept from falling below zero
    fall: Float[Array, "c h q"]  # of the covariance with the query points, for their slopes


def _forward(
    belief: Belief, points: Float[Array, "c h 2"], taken: Bool[Array, "c h"]
) -> tuple[Float[Array, "c q"], _Residuals]:
    # Covariance and slope have the same exponential, which is as dear as a product of matrices.
    kernel, distance = belief.kernel, belief.kernel.distance(points[:, :, None, :], belief.query)
    virtual = virtual_measurements(belief, points, taken, kernel.correlation(distance, kernel.variance))
    left = belief.variance - jnp.sum(virtual.rows * virtual.rows, axis=1)
    # The transpose made first: as part of the product it takes three times as long on a CPU.
    transposed = lax.optimization_barrier(jnp.swapaxes(virtual.inverse_factor, 1, 2))
    solved = transposed @ virtual.rows
    return jnp.maximum(left, 0.0), _Residuals(belief, points, virtual.whitened, solved, left, kernel.fall(distance))


def _backward(kept: _Residuals, slope: Float[Array, "c q"]) -> tuple[None, Float[Array, "c h 2"], None]:
    belief, points, whitened, solved, left, fall = kept
    weighted = jnp.where(left > 0, slope, 0.0)[:, None] * solved
    residual = -2.0 * belief.effect(weighted)  # slopes in R, in C, in W and in k(P, X)
    own = jnp.einsum("chq,cgq->chg", weighted, solved)
    rows = -(residual @ belief.whitened_query.T) - 2.0 * own @ whitened
    covariance = jnp.where(belief.mask, rows @ belief.inverse_factor, 0.0)
    # A point's own variance does not depend on where it is, and every pair counts twice.
    pairs = jax.vmap(lambda points, own: _pull(belief.kernel, points, points, 2.0 * own))(points, own)
    pull = _pull(belief.kernel, points, belief.query, residual, fall)
    return None, pull + _pull(belief.kernel, points, belief.x, covariance) + pairs, None


variance_left.defvjp(_forward, _backward)


def _pull(
    kernel: Kernel,
    points: Float[Array, "*p 2"],
    others: Float[Array, "o 2"],
    weight: Float[Array, "*p o"],
    fall: Float[Array, "*p o"] | None = None,
) -> Float[Array, "*p 2"]:
    """Slope in each point of the weighted sum of its covariances with the others.

    A correlation that depends on the distance r alone has the slope -fall(r) (point - other) in the units of r; `fall`
    is that of all pairs, if it is there already.
    """
    scale = kernel.stretch / jnp.asarray(kernel.length_scale, points.dtype)
    if fall is None:
        fall = kernel.fall(kernel.distance(points[..., None, :], others))
    if kernel.warp is not None:
        alike = type(kernel)(kernel.length_scale, kernel.variance)
        return _pull(alike, points @ kernel.warp, others @ kernel.warp, weight, fall) @ kernel.warp
    weight = weight * fall
    # One product, which a CPU does faster than sums along the last axis.
    sums = weight @ jnp.concatenate([others, jnp.ones_like(others[:, :1])], axis=-1)
    return kernel.variance * scale * scale * (sums[..., :2] - points * sums[..., 2:])
