"""Ground truth drawn from a Gaussian-process prior, conditioned on what old samples measured.

A draw of the prior is a sum of random waves (Rahimi & Recht 2007); a correction around the samples turns it into a draw
of the posterior (Matheron's rule; Wilson et al. 2020, "Efficiently sampling functions from Gaussian process
posteriors").
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from maipp.belief import Matern32
from maipp.belief.fit_samples import thinned
from maipp.belief.likelihood import correlation, squared_differences
from maipp.errors import InputError
from maipp.typing import Array, Float, Key

# Every draw has waves of its own, so that means and covariances over many draws are exact whatever their number; over
# the area of one draw the covariance is off by about 1 / sqrt(2 * WAVES) = 2 % of the variance.
WAVES = 1024

MOST_SAMPLES = 2000  # more are thinned by place, as for the fit of the kernel

# Added to the noise, in units of the prior variance: what keeps the corrections small enough for float32.
_NUGGET = 1e-6


class PosteriorField(eqx.Module):
    """One draw of a Gaussian process: a callable from points (n, 2) to values (n,); domain units and field units."""

    frequency: Float[Array, "*b w 2"]  # of each wave, radians per domain unit
    phase: Float[Array, "*b w"]  # radians
    length_scale: Float[Array, "*b"]  # of the Matern 3/2 kernel, domain units
    variance: Float[Array, "*b"]  # of the prior, squared field units
    mean: Float[Array, "*b"]  # of the prior
    samples: Float[Array, "*b p 2"]  # where the field was measured
    weights: Float[Array, "*b p"]  # of the kernel around each sample; without samples there is one of weight 0

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Field values at the points."""
        points = jnp.asarray(points)
        waves = jnp.cos(points @ self.frequency.T + self.phase).sum(axis=-1)
        correction = Matern32(self.length_scale, self.variance).matrix(points, self.samples) @ self.weights
        return self.mean + jnp.sqrt(2.0 * self.variance / self.phase.shape[-1]) * waves + correction


def draw_fields(
    key: Key,
    kernel: Matern32,
    instances: int,
    *,
    mean: float = 0.0,
    x: Float[np.ndarray | Array, "p 2"] | None = None,
    y: Float[np.ndarray | Array, " p"] | None = None,
    noise: float = 1e-6,
    waves: int = WAVES,
) -> PosteriorField:
    """`instances` draws of a Gaussian process with one length scale, as a batch with a leading axis on every array.

    With samples `y` at `x` (at most 2,000 are used, chosen by place) they are draws of its posterior: they pass the
    samples within their `noise` (a variance). Draw i of a key is the same whatever the number of draws. Raises
    InputError for a noise below 0 and for samples without values.
    """
    if noise < 0:
        raise InputError(f"noise: {noise} is below 0; give the variance of the samples' noise")
    if (x is None) != (y is None):
        raise InputError("samples: positions need values and values need positions; give both x and y, or neither")
    at, values = np.zeros((0, 2)) if x is None else np.asarray(x, np.float64), np.asarray([] if y is None else y)
    keep = thinned(at, MOST_SAMPLES) if len(at) else slice(0)
    at, values = at[keep], values[keep].astype(np.float64)
    scale, variance = float(kernel.length_scale), float(kernel.variance)

    def draw(index: Array) -> tuple[Array, Array, Array]:
        of_scale, of_normal, of_phase, of_noise = jax.random.split(jax.random.fold_in(key, index), 4)
        # The spectrum of Matern 3/2 in the plane is a Student t with 3 degrees of freedom.
        stretch = jnp.sqrt(1.5 / jax.random.gamma(of_scale, 1.5, (waves, 1)))
        frequency = jax.random.normal(of_normal, (waves, 2)) * stretch / scale
        phase = jax.random.uniform(of_phase, (waves,), maxval=2 * jnp.pi)
        return frequency, phase, jax.random.normal(of_noise, (len(at),))

    def every(number: float) -> Array:
        return jnp.full(instances, number, frequency.dtype)

    frequency, phase, errors = jax.jit(jax.vmap(draw))(jnp.arange(instances))
    # Arrays without elements cannot be split over devices.
    shown = at if len(at) else np.zeros((1, 2))
    prior = PosteriorField(
        frequency,
        phase,
        every(scale),
        every(variance),
        every(mean),
        jnp.broadcast_to(jnp.asarray(shown, frequency.dtype), (instances, *shown.shape)),
        jnp.zeros((instances, len(shown)), frequency.dtype),
    )
    if not len(at):
        return prior
    rest = values - mean - np.sqrt(noise) * np.asarray(errors, np.float64) - _waves(prior, at, variance)
    covariance = variance * correlation(squared_differences(at, per_axis=False), np.array([scale]))[0]
    covariance[np.diag_indices(len(at))] += noise + _NUGGET * variance
    weights = cho_solve(cho_factor(covariance, lower=True), rest.T).T
    return eqx.tree_at(lambda field: field.weights, prior, jnp.asarray(weights, frequency.dtype))


def _waves(fields: PosteriorField, at: np.ndarray, variance: float) -> Float[np.ndarray, "b p"]:
    """The draws of the prior at the samples, less its mean, in float64."""
    amplitude = np.sqrt(2.0 * variance / fields.phase.shape[-1])
    return np.stack(
        [
            amplitude * np.cos(at @ frequency.T + phase).sum(axis=-1)
            for frequency, phase in zip(
                np.asarray(fields.frequency, np.float64), np.asarray(fields.phase, np.float64), strict=True
            )
        ]
    )
