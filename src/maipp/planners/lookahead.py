"""What the belief would be after travelling given waypoints: the one place every planner asks.

A hypothetical measurement reads the parent belief's rows in place: with V = L^-1 K(X, Q), one more point p adds the
row `(k(p, Q) - (L^-1 k(X, p))^T V) / pivot`, and the variance falls by the square of the row. Nothing is refitted.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, Interest
from maipp.typing import Array, Bool, Float, Real, Vector

# Added to the candidates' own covariance, in units of the float's spacing: a virtual measurement on top of a real one
# has nothing left to remove, and rounding takes its residual variance to a little below zero.
_NUGGET = 64


def measurement_offsets(to_next: Float[Array, ""], interval: Real, count: int) -> Vector:
    """Distances travelled from here to each of the next `count` measurements (domain units)."""
    return to_next + interval * jnp.arange(count)


class VirtualMeasurements(NamedTuple):
    """Candidate measurements as rows appended to a belief; candidates c, measurements h each, query points q."""

    rows: Float[Array, "c h q"]  # what each would add to V, `Belief.effect`
    whitened: Float[Array, "c h n"]  # L^-1 k(X, p)
    inverse_factor: Float[Array, "c h h"]  # inverse of the Cholesky factor of the candidates' own covariance


def virtual_measurements(
    belief: Belief,
    points: Float[Array, "c h 2"],
    taken: Bool[Array, "c h"],
    covariance: Float[Array, "c h q"] | None = None,
) -> VirtualMeasurements:
    """The rows that each candidate's measurements would add; `taken=False` adds nothing.

    `covariance` is that of the points and the belief's query, if it is there already.
    """
    prior = jnp.asarray(belief.kernel.variance, points.dtype)
    whitened = belief.whiten(points)
    cross = belief.kernel(points[:, :, None, :], belief.query) if covariance is None else covariance
    residual = cross - whitened @ belief.whitened_query
    between = belief.kernel(points[:, :, None, :], points[:, None, :, :]) - jnp.einsum(
        "chn,cgn->chg", whitened, whitened
    )
    pair = taken[:, :, None] & taken[:, None, :]
    identity = jnp.eye(points.shape[1], dtype=points.dtype)
    nugget = jnp.maximum(belief.noise, _NUGGET * jnp.finfo(points.dtype).eps * prior)
    own = jnp.where(pair, between, prior * identity) + nugget * identity
    inverse = lax.linalg.triangular_solve(
        jnp.linalg.cholesky(own), jnp.broadcast_to(identity, own.shape), left_side=True, lower=True
    )
    # A candidate that float32 cannot factor all the same measures where everything is known: it adds nothing.
    inverse = jnp.where(jnp.isfinite(inverse).all(axis=(1, 2), keepdims=True), inverse, 0.0)
    rows = jnp.einsum("chg,cgq->chq", inverse, jnp.where(taken[:, :, None], residual, 0.0))
    return VirtualMeasurements(belief.effect(rows), whitened, inverse)


def predicted_variance(belief: Belief, points: Float[Array, "c h 2"], taken: Bool[Array, "c h"]) -> Float[Array, "c q"]:
    """Variance at the query points after each candidate's measurements."""
    rows = virtual_measurements(belief, points, taken).rows
    return jnp.maximum(belief.variance - jnp.sum(rows * rows, axis=1), 0.0)


def predicted(
    belief: Belief, points: Float[Array, "c h 2"], taken: Bool[Array, "c h"], *, virtual_value: str = "mean"
) -> tuple[Float[Array, "c q"], Float[Array, "c q"]]:
    """Mean and variance at the query points after each candidate's measurements.

    `virtual_value="mean"` measures the predicted mean, so only the covariance changes (paper Sec. IV-B); `"zero"`
    measures zero everywhere.
    """
    virtual = virtual_measurements(belief, points, taken)
    variance = jnp.maximum(belief.variance - jnp.sum(virtual.rows * virtual.rows, axis=1), 0.0)
    mean = jnp.broadcast_to(belief.mean, variance.shape)
    if virtual_value == "zero":
        expected = virtual.whitened @ belief.whitened_values  # (c, h) what the belief expects there
        innovation = jnp.einsum("chg,cg->ch", virtual.inverse_factor, jnp.where(taken, -expected, 0.0))
        mean = mean + jnp.einsum("ch,chq->cq", innovation, virtual.rows)
    return mean, variance


def predicted_trace(
    belief: Belief,
    interest: Interest,
    inside: Bool[Array, " q"],
    points: Float[Array, "c h 2"],
    taken: Bool[Array, "c h"],
    *,
    virtual_value: str = "mean",
) -> Float[Array, " c"]:
    """Tr(P) over the refreshed high-interest area after each candidate's measurements, valued as in `predicted`."""
    return interest.trace(*predicted(belief, points, taken, virtual_value=virtual_value), inside)
