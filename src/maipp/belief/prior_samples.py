"""Samples taken before the survey: every belief is conditioned on them, whatever the robots have measured."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax

from maipp.belief.kernel import Kernel
from maipp.belief.posterior import condition, nugget_factor
from maipp.typing import Array, Bool, Float


class Measurements(NamedTuple):
    """What `condition` and `condition_near` take of a set of measurements."""

    x: Float[Array, "n 2"]  # positions, domain units
    y: Float[Array, " n"]  # values
    mask: Bool[Array, " n"]  # True where a slot holds a measurement
    extra_noise: Float[Array, " n"] | None = None  # what the noise variance of each exceeds the robots' by


class PriorSamples(NamedTuple):
    """Old measurements: known to every agent from the start. On the device, or in a record on the host."""

    x: Float[Array | np.ndarray, "p 2"]  # positions, domain units; anywhere, outside the domain as well
    y: Float[Array | np.ndarray, " p"]  # values, standardised
    noise: Float[Array | np.ndarray, " p"] | None = (
        None  # noise variance of each; None: that of the robots' measurements
    )

    def extra_noise(self, noise: float | Float[Array, ""]) -> Float[Array, " p"] | None:
        """What the samples' noise variance exceeds the robots' `noise` by; below 0 where the samples are better."""
        return None if self.noise is None else jnp.asarray(self.noise) - noise

    def after(
        self, x: Float[Array, "n 2"], y: Float[Array, " n"], mask: Bool[Array, " n"], noise: float | Float[Array, ""]
    ) -> Measurements:
        """The masked measurements of the robots, taken with `noise`, and after them the samples, all of them known."""
        extra = self.extra_noise(noise)
        return Measurements(
            jnp.concatenate([x, self.x]),
            jnp.concatenate([y, self.y]),
            jnp.concatenate([mask, jnp.ones(self.y.shape[0], bool)]),
            None if extra is None else jnp.concatenate([jnp.zeros_like(y), extra]),
        )

    def process(
        self, kernel: Kernel, x: Float[Array, "n 2"], query: Float[Array, "q 2"], noise: float | Float[Array, ""]
    ) -> "SampledProcess":
        """The GP given the samples, at the places `x` of later measurements and at `query`.

        It takes p^3 operations once; every belief that follows costs no more than one without samples.
        """
        known = jnp.ones(self.y.shape[0], bool)
        everywhere = jnp.concatenate([x, query])
        belief = condition(
            kernel, jnp.asarray(self.x), jnp.asarray(self.y), known, everywhere, noise, self.extra_noise(noise)
        )
        slots = x.shape[0]
        rows, query_rows = belief.whitened_query[:, :slots], belief.whitened_query[:, slots:]
        return SampledProcess(
            expected=belief.mean[:slots],
            covariance=kernel.matrix(x, x) - rows.T @ rows,
            cross=kernel.matrix(x, query) - rows.T @ query_rows,
            mean=belief.mean[slots:],
            variance=belief.variance[slots:],
            scale=jnp.asarray(kernel.variance, x.dtype),
        )


class SampledProcess(NamedTuple):
    """A GP conditioned on prior samples, at n slots for later measurements and at q query points."""

    expected: Float[Array, " n"]  # mean at the slots
    covariance: Float[Array, "n n"]  # between the slots
    cross: Float[Array, "n q"]  # covariance between slots and query points
    mean: Float[Array, " q"]
    variance: Float[Array, " q"]
    scale: Float[Array, ""]  # variance of the field before anything was measured

    def given(
        self, y: Float[Array, " n"], mask: Bool[Array, " n"], noise: float | Float[Array, ""]
    ) -> tuple[Float[Array, " q"], Float[Array, " q"]]:
        """Mean and variance at the query points after the measurements whose mask is True as well.

        As in `condition`, the nugget grows where the matrix cannot be factored: a measurement on top of a sample has
        next to no variance left.
        """
        pair = mask[:, None] & mask[None, :]
        gram = jnp.where(pair, self.covariance, 0.0) + jnp.diag(jnp.where(mask, 0.0, self.scale))
        factor, _ = nugget_factor(gram, jnp.asarray(noise, gram.dtype), self.scale)
        cross = jnp.where(mask[:, None], self.cross, 0.0)
        surprise = jnp.where(mask, y - self.expected, 0.0)
        solved = lax.linalg.triangular_solve(
            factor, jnp.concatenate([cross, surprise[:, None]], axis=1), left_side=True, lower=True
        )
        rows, values = solved[:, :-1], solved[:, -1]
        variance = jnp.maximum(self.variance - jnp.sum(rows * rows, axis=0), 0.0)
        return self.mean + values @ rows, variance
