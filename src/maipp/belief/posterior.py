"""Gaussian-process posterior: condition on masked measurements, predict anywhere.

Exact, but for a belief that holds only a window of a survey with more measurements than fit (`belief/window.py`).
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief.kernel import Kernel
from maipp.belief.tiles import OrderedMeasurements, tile_moments
from maipp.typing import Array, Bool, Float, Int

# The nugget is multiplied by this until the factor is finite: near-duplicate measurements in float32 need it. Where it
# starts and ends is in units of the signal variance, as float32's rounding is.
_NUGGET_GROWTH = 10.0
_NUGGET_START = 1e-7
_NUGGET_LIMIT = 1e-1


class Belief(eqx.Module):
    """A zero-mean GP conditioned on measurements, with its prediction at a fixed set of query points.

    Slots that hold no measurement are identity rows of the factor and zero rows of everything else, so the shapes
    depend only on the number of slots n and of query points q. A belief whose matrix could not be factored
    (`nugget_factor`) says so: its mean and variance are NaN at every query point, and so is every Tr(P) of it.
    """

    kernel: Kernel
    x: Float[Array, "n 2"]  # measured positions, domain units
    y: Float[Array, " n"]  # measured values; they mean something where the mask is True
    mask: Bool[Array, " n"]  # True where a slot holds a measurement
    inverse_factor: Float[Array, "n n"]  # L^-1 of K(X, X) + noise I
    whitened_values: Float[Array, " n"]  # L^-1 y
    query: Float[Array, "q 2"]  # query points, domain units
    whitened_query: Float[Array, "n q"]  # V = L^-1 K(X, Q)
    mean: Float[Array, " q"]  # posterior mean at the query points
    variance: Float[Array, " q"]  # posterior variance at the query points, >= 0
    noise: Float[Array, ""]  # noise variance actually used
    extra_noise: Float[Array, " n"] | None = None  # what that of each measurement exceeds it by; None: nothing
    # Of a belief whose slots hold only a part of what is known (`belief/window.py`), else None:
    survey: OrderedMeasurements | None = None  # all of it
    shrink: Float[Array, " q"] | None = None  # std at the query points given all of it, over that given the slots
    window: int = eqx.field(static=True, default=0)  # slots that hold the part; virtual measurements come after them

    @property
    def std(self) -> Float[Array, " q"]:
        """Posterior standard deviation at the query points."""
        return jnp.sqrt(self.variance)

    def at(self, index: Int[Array, " i"]) -> "Belief":
        """The same belief with only some of its query points: a coarser grid for a cheaper look ahead."""
        coarse = eqx.tree_at(
            lambda b: (b.query, b.whitened_query, b.mean, b.variance),
            self,
            (self.query[index], self.whitened_query[:, index], self.mean[index], self.variance[index]),
        )
        return coarse if self.shrink is None else eqx.tree_at(lambda b: b.shrink, coarse, self.shrink[index])

    def on(self, points: Float[Array, "p 2"]) -> "Belief":
        """The same measurements, with their prediction at other query points."""
        whitened = self.whiten(points).T
        if self.survey is not None:
            moved = eqx.tree_at(lambda b: (b.query, b.whitened_query), self, (points, whitened))
            return _with_survey(moved, self.survey)
        variance = jnp.asarray(self.kernel.variance, points.dtype) - jnp.sum(whitened * whitened, axis=0)
        return eqx.tree_at(
            lambda b: (b.query, b.whitened_query, b.mean, b.variance),
            self,
            (points, whitened, self.whitened_values @ whitened, jnp.maximum(variance, 0.0)),
        )

    def whiten(self, points: Float[Array, "*p 2"]) -> Float[Array, "*p n"]:
        """L^-1 k(X, p) for every point p: what one hypothetical measurement needs from the parent's rows."""
        covariance = jnp.where(self.mask, self.kernel(points[..., None, :], self.x), 0.0)
        return covariance @ self.inverse_factor.T

    def effect(self, rows: Float[Array, "*r q"]) -> Float[Array, "*r q"]:
        """What rows added to V do at the query points: their squares are taken from the variance there."""
        return rows if self.shrink is None else rows * self.shrink


def _with_survey(belief: Belief, survey: OrderedMeasurements) -> Belief:
    """A belief on a window of the survey, its mean, variance and `shrink` made those of the whole survey."""
    part, virtual = belief.whitened_query[: belief.window], belief.whitened_query[belief.window :]
    values = belief.whitened_values
    prior = jnp.asarray(belief.kernel.variance, part.dtype)
    # Below this nothing is left that float32 could tell from rounding.
    least = jnp.finfo(part.dtype).eps * prior
    near = jnp.maximum(prior - jnp.sum(part * part, axis=0), 0.0), values[: belief.window] @ part

    def all_known() -> tuple[Array, Array, Array]:
        return *near, jnp.ones_like(near[0])

    def with_tiles() -> tuple[Array, Array, Array]:
        mean, variance = tile_moments(belief.kernel, survey, belief.query)
        # Both are given a part of the survey, so both variances are at least the true one: the lower one is nearer.
        better = variance < near[0]
        variance = jnp.where(better, variance, near[0])
        ratio = jnp.where(better, jnp.maximum(variance, least) / jnp.maximum(near[0], least), 1.0)
        return variance, jnp.where(better, mean, near[1]), jnp.sqrt(ratio)

    variance, mean, shrink = lax.cond(jnp.sum(survey.mask) <= belief.window, all_known, with_tiles)
    virtual = virtual * shrink
    return eqx.tree_at(
        lambda b: (b.mean, b.variance, b.shrink),
        belief,
        (
            mean + values[belief.window :] @ virtual,
            jnp.maximum(variance - jnp.sum(virtual * virtual, axis=0), 0.0),
            shrink,
        ),
    )


@jax.custom_jvp
def nugget_factor(
    gram: Float[Array, "n n"], noise: Float[Array, ""], signal: Float[Array, ""]
) -> tuple[Float[Array, "n n"], Float[Array, ""]]:
    """Lower Cholesky factor of `gram + nugget I`, and the nugget: `noise`, or more where that is not finite.

    `signal` is the signal variance: the unit of the nugget's growth. A matrix that a tenth of it does not help (it
    holds NaN, or more than the float can) has a factor of NaN. The factor has a derivative in `gram` alone, with the
    nugget as it is.
    """

    def fails(tried: tuple[Array, Array]) -> Bool[Array, ""]:
        factor, nugget = tried
        return ~jnp.isfinite(factor).all() & (nugget < _NUGGET_LIMIT * signal)

    def grow(tried: tuple[Array, Array]) -> tuple[Array, Array]:
        nugget = jnp.maximum(tried[1] * _NUGGET_GROWTH, _NUGGET_START * signal)
        return _factor(gram, nugget), nugget

    return lax.while_loop(fails, grow, (_factor(gram, noise), noise))


@nugget_factor.defjvp
def _(primals: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[Any, Any]:
    """The derivative with the nugget that was found: a loop cannot be differentiated backwards."""
    nugget = nugget_factor(*lax.stop_gradient(primals))[1]
    factor, slope = jax.jvp(lambda gram: _factor(gram, nugget), primals[:1], tangents[:1])
    return (factor, nugget), (slope, jnp.zeros_like(nugget))


def _factor(gram: Float[Array, "n n"], nugget: Float[Array, ""]) -> Float[Array, "n n"]:
    return jnp.linalg.cholesky(gram + nugget * jnp.eye(gram.shape[0], dtype=gram.dtype))


def condition(
    kernel: Kernel,
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    mask: Bool[Array, " n"],
    query: Float[Array, "q 2"],
    noise: float | Float[Array, ""] = 1e-6,
    extra_noise: Float[Array, " n"] | None = None,
) -> Belief:
    """Belief after the measurements whose mask is True, with predictions at `query`.

    `noise` is the measurement variance added to the diagonal, `extra_noise` what that of each measurement exceeds it
    by. Where float32 cannot factor the matrix (duplicate points), the nugget grows tenfold until it can; where it never
    can, mean and variance are NaN. Source: Rasmussen & Williams 2006, Alg. 2.1.
    """
    pair = mask[:, None] & mask[None, :]
    prior = jnp.asarray(kernel.variance, x.dtype)
    gram = jnp.where(pair, kernel.matrix(x, x), 0.0)
    gram = gram + jnp.diag(jnp.where(mask, 0.0 if extra_noise is None else extra_noise, prior))
    factor, nugget = nugget_factor(gram, jnp.asarray(noise, x.dtype), prior)
    identity = jnp.eye(x.shape[0], dtype=x.dtype)
    inverse = lax.linalg.triangular_solve(factor, identity, left_side=True, lower=True)
    cross = jnp.where(mask[:, None], kernel.matrix(x, query), 0.0)
    whitened_query = inverse @ cross
    whitened_values = inverse @ jnp.where(mask, y, 0.0)
    variance = jnp.maximum(prior - jnp.sum(whitened_query * whitened_query, axis=0), 0.0)
    return Belief(
        kernel=kernel,
        x=x,
        y=y,
        mask=mask,
        inverse_factor=inverse,
        whitened_values=whitened_values,
        query=query,
        whitened_query=whitened_query,
        mean=whitened_values @ whitened_query,
        variance=variance,
        noise=nugget,
        extra_noise=extra_noise,
    )


def condition_window(
    kernel: Kernel,
    survey: OrderedMeasurements,
    slots: Int[Array, " r"],
    query: Float[Array, "q 2"],
) -> Belief:
    """Belief on the measurements in some slots of a survey, with the predictions of the whole survey at `query`.

    Where the slots hold all that is known it is exact.
    """
    extra = None if survey.extra_noise is None else survey.extra_noise[slots]
    part = condition(kernel, survey.x[slots], survey.y[slots], survey.mask[slots], query, survey.noise, extra)
    ready = dataclasses.replace(part, survey=survey, shrink=jnp.ones_like(part.mean), window=slots.shape[0])
    return _with_survey(ready, survey)


def extend(
    belief: Belief,
    x: Float[Array, "p 2"],
    mask: Bool[Array, " p"],
    *,
    virtual_value: str = "mean",
) -> Belief:
    """Belief with p virtual measurements added in p new slots, as if they had been taken already.

    `virtual_value="mean"` takes the predicted mean as their value, so that only the covariance changes (paper
    Sec. IV-B); `"zero"` measures zero everywhere, as the public reference code does.
    """
    rows = jnp.where(mask[:, None], belief.whiten(x), 0.0)  # (p, n) L^-1 k(X, x)
    prior = jnp.asarray(belief.kernel.variance, x.dtype)
    pair = mask[:, None] & mask[None, :]
    schur = jnp.where(pair, belief.kernel.matrix(x, x) - rows @ rows.T, 0.0) + jnp.diag(jnp.where(mask, 0.0, prior))
    factor, _ = nugget_factor(schur, belief.noise, prior)
    identity = jnp.eye(x.shape[0], dtype=x.dtype)
    inverse = lax.linalg.triangular_solve(factor, identity, left_side=True, lower=True)
    cross = jnp.where(mask[:, None], belief.kernel.matrix(x, belief.query) - rows @ belief.whitened_query, 0.0)
    query_rows = inverse @ cross
    n, p = belief.x.shape[0], x.shape[0]
    inverse_factor = jnp.zeros((n + p, n + p), x.dtype)
    inverse_factor = inverse_factor.at[:n, :n].set(belief.inverse_factor)
    inverse_factor = inverse_factor.at[n:, :n].set(-inverse @ (rows @ belief.inverse_factor))
    inverse_factor = inverse_factor.at[n:, n:].set(inverse)
    innovation = jnp.where(mask, -(rows @ belief.whitened_values), 0.0) if virtual_value == "zero" else jnp.zeros(p)
    values = inverse @ innovation.astype(x.dtype)
    effect = belief.effect(query_rows)
    expected = jnp.zeros(p, x.dtype) if virtual_value == "zero" else rows @ belief.whitened_values
    extra_noise = belief.extra_noise
    return dataclasses.replace(
        belief,
        x=jnp.concatenate([belief.x, x]),
        y=jnp.concatenate([belief.y, expected]),
        extra_noise=None if extra_noise is None else jnp.concatenate([extra_noise, jnp.zeros(p, x.dtype)]),
        mask=jnp.concatenate([belief.mask, mask]),
        inverse_factor=inverse_factor,
        whitened_values=jnp.concatenate([belief.whitened_values, values]),
        whitened_query=jnp.concatenate([belief.whitened_query, query_rows]),
        mean=belief.mean + values @ effect,
        variance=jnp.maximum(belief.variance - jnp.sum(effect * effect, axis=0), 0.0),
    )
