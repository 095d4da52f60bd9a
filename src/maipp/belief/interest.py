"""The high-interest area and the quality measures taken over it."""

import equinox as eqx
import jax.numpy as jnp
from jax.scipy.special import ndtr

from maipp.belief.posterior import Belief
from maipp.typing import Array, Bool, Float, Real


class Interest(eqx.Module):
    """What a survey is after: the rule that says which points are of high interest."""

    threshold: Real = 0.4  # normalised field units
    beta: Real = 1.0  # width of the confidence bound
    rule: str = eqx.field(static=True, default="std")  # "std" or "variance"

    def bound(self, mean: Float[Array, "*q"], variance: Float[Array, "*q"]) -> Float[Array, "*q"]:
        """Upper confidence bound (paper Sec. III-B): `mean + beta * std`, which the paper's numbers fit.

        Under the rule "variance" `mean + beta * variance`, the formula as printed. Raises ValueError on any other rule.
        """
        if self.rule not in ("std", "variance"):
            raise ValueError(f"rule={self.rule!r}: the high-interest rule is 'std' or 'variance'")
        return mean + self.beta * (variance if self.rule == "variance" else jnp.sqrt(jnp.maximum(variance, 0.0)))

    def area(
        self, mean: Float[Array, "*q"], variance: Float[Array, "*q"], inside: Bool[Array, "*i"]
    ) -> Bool[Array, "*q"]:
        """The predicted high-interest area: the points inside the domain whose bound reaches the threshold.

        What is not a number is not known to stay below it, and so belongs to the area.
        """
        return ~(self.bound(mean, variance) < self.threshold) & inside

    def trace(
        self, mean: Float[Array, "*b q"], variance: Float[Array, "*b q"], inside: Bool[Array, " q"]
    ) -> Float[Array, "*b"]:
        """Tr(P) over the predicted high-interest area of this mean and variance; leading axes are kept.

        NaN where the mean or variance of any point inside is not finite: such a belief must not pass for a good one.
        """
        left = jnp.where(self.area(mean, variance, inside), variance, 0.0)
        return jnp.sum(jnp.where(inside & ~jnp.isfinite(mean + variance), jnp.nan, left), axis=-1)

    def expected_trace(
        self,
        mean: Float[Array, "*b q"],
        variance: Float[Array, "*b q"],
        known: Float[Array, " q"],
        inside: Bool[Array, " q"],
        *,
        spread: Real = 1.0,
        blur: float,
    ) -> Float[Array, "*b"]:
        """Tr(P) expected once planned measurements have been taken; smooth in the variance.

        `variance` is what the measurements leave of the `known` variance now. Their values are not known yet: by the
        belief, the mean at a point will be normal around `mean` with variance `known - variance`, which says how
        likely the point is to stay in the area. `spread` scales that deviation; `blur` (field units, > 0) is added to
        it in squares. Without spread it is the exact trace as `blur` -> 0. NaN inside makes NaN.
        """
        # The square root has no slope at a variance of zero; a point that well known weighs nothing.
        bound = self.bound(mean, jnp.maximum(variance, 1e-8))
        width = jnp.sqrt(spread**2 * jnp.maximum(known - variance, 0.0) + blur**2)
        return jnp.sum(jnp.where(inside, ndtr((bound - self.threshold) / width) * variance, 0.0), axis=-1)


def trace(variance: Float[Array, "*q"], area: Bool[Array, "*q"]) -> Float[Array, ""]:
    """Tr(P) over an area: the sum of the posterior variances of its points, NaN where any of them is."""
    return jnp.sum(jnp.where(area, variance, 0.0))


def to_rank(scores: Float[Array, "*c"]) -> Float[Array, "*c"]:
    """The scores to choose the lowest of: what is not a finite number is as bad as a number can be, but not barred.

    `jnp.argmin` would take NaN for the lowest of all.
    """
    return jnp.nan_to_num(scores, nan=jnp.finfo(scores.dtype).max)


def rmse(mean: Float[Array, " q"], truth: Float[Array, " q"], inside: Bool[Array, " q"]) -> Float[Array, ""]:
    """Root mean squared error of the predicted mean over the points inside the domain, field units."""
    squared = jnp.where(inside, (mean - truth) ** 2, 0.0)
    return jnp.sqrt(jnp.sum(squared) / jnp.maximum(jnp.sum(inside), 1))


def mutual_information(belief: Belief, area: Bool[Array, " q"], scale: float = 0.01) -> Float[Array, ""]:
    """`0.5 logdet(scale * P + I)` over an area, P the posterior covariance between its points, in nats."""
    prior = belief.kernel.matrix(belief.query, belief.query)
    covariance = prior - belief.whitened_query.T @ belief.whitened_query
    if belief.shrink is not None:
        covariance = belief.shrink[:, None] * covariance * belief.shrink
    pair = area[:, None] & area[None, :]
    matrix = jnp.eye(area.shape[0], dtype=prior.dtype) + scale * jnp.where(pair, covariance, 0.0)
    diagonal = jnp.diagonal(jnp.linalg.cholesky(matrix))
    return jnp.sum(jnp.log(diagonal))
