"""Fields to foresee: the families that the training mixes, each one's fields drawn afresh for every sample."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.fields.mixture import GaussianMixture, evaluation_grid
from maipp.scenario import Scenario
from maipp.typing import Array, Float, Index, Int, Key

# Waves of a draw of a Gaussian process: its covariance over the area is off by about 1 / sqrt(2 * waves) = 4 %.
_WAVES = 384

# Smoothness of the processes' kernels: Matern 1/2, 3/2, 5/2, and what stands for the squared exponential.
_SMOOTHNESS = (0.5, 1.5, 2.5, 50.0)
_LENGTHS = (0.1, 0.8)  # their length scales, drawn by the logarithm

# Families besides the default scenario's: fewer, more, narrower and wider bumps, and other domains.
_OTHERS: tuple[dict[str, tuple[float, float]], ...] = (
    {"mixture_components": (3, 6)},
    {"mixture_components": (5, 9)},
    {"mixture_components": (12, 20)},
    {"mixture_variance": (1e-5, 5e-5)},
    {"mixture_variance": (2e-4, 6e-4)},
    {"mixture_variance": (2e-5, 4e-4)},
    {"extent": (1.0, 0.6)},
    {"extent": (1.2, 0.9)},
)


class Families(NamedTuple):
    """Families of bumps as numbers, f of them; the first is the default scenario's."""

    fewest: Int[Array, " f"]
    most: Int[Array, " f"]
    variance: Float[Array, "f 2"]  # range of the square of a bump's variance along an axis
    extent: Float[Array, "f 2"]


def family_scenarios() -> list[Scenario]:
    """A scenario for each family of bumps."""
    return [Scenario(), *(Scenario.create(**values) for values in _OTHERS)]


def families_of(scenarios: list[Scenario]) -> Families:
    """The numbers of these scenarios' families."""
    fewest, most = zip(*(each.mixture_components for each in scenarios), strict=True)
    return Families(
        jnp.asarray(fewest),
        jnp.asarray(most),
        jnp.asarray([each.mixture_variance for each in scenarios], jnp.result_type(float)),
        jnp.asarray([each.extent for each in scenarios], jnp.result_type(float)),
    )


def most_bumps() -> int:
    """Bumps that any of the families' fields may have."""
    return max(each.mixture_components[1] for each in family_scenarios())


def draw_bumps(key: Key, families: Families, family: Index, most: int) -> GaussianMixture:
    """A field of that family, as `sample_mixture` draws it; `most` bumps there is room for."""
    count_key, mean_key, sigma_key = jax.random.split(key, 3)
    extent, (low, high) = families.extent[family], families.variance[family]
    count = jax.random.randint(count_key, (), families.fewest[family], families.most[family] + 1)
    mean = jax.random.uniform(mean_key, (most, 2)) * extent
    sigma = jnp.sqrt(jax.random.uniform(sigma_key, (most, 2), minval=low, maxval=high))
    return GaussianMixture(mean, sigma, present=jnp.arange(most) < count, grid=evaluation_grid(30, extent))


class Waves(eqx.Module):
    """A draw of a Gaussian process as a sum of random waves, with level and scale of its own."""

    frequency: Float[Array, "w 2"]  # radians per domain unit
    phase: Float[Array, " w"]
    level: Float[Array, ""]
    scale: Float[Array, ""]
    length_scale: Float[Array, ""]  # of the kernel, domain units

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Field values at points."""
        waves = jnp.cos(points @ self.frequency.T + self.phase).sum(axis=-1)
        return self.level + self.scale * jnp.sqrt(2.0 / self.phase.shape[0]) * waves


def draw_process(key: Key) -> Waves:
    """A draw of a process of a random kernel; half of them standardised, half about between 0 and 1."""
    keys = jax.random.split(key, 7)
    smoothness = jnp.asarray(_SMOOTHNESS)[jax.random.randint(keys[0], (), 0, len(_SMOOTHNESS))]
    length = jnp.exp(jax.random.uniform(keys[1], (), minval=jnp.log(_LENGTHS[0]), maxval=jnp.log(_LENGTHS[1])))
    # The spectrum of a Matern kernel in the plane is a Student t.
    stretch = jnp.sqrt(smoothness / jnp.maximum(jax.random.gamma(keys[2], smoothness, (_WAVES, 1)), 1e-3))
    frequency = jax.random.normal(keys[3], (_WAVES, 2)) * stretch / length
    phase = jax.random.uniform(keys[4], (_WAVES,), maxval=2 * jnp.pi)
    small = jax.random.bernoulli(keys[5])
    level = jnp.where(small, 0.3, 0.0) + jnp.where(small, 0.1, 0.4) * jax.random.normal(keys[6])
    return Waves(frequency, phase, level, jnp.where(small, 0.25, 1.0), length)
