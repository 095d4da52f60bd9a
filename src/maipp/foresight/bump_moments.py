"""The numbers of a `Bumps` for a scenario: the closed form fitted to the moments of fields that are drawn."""

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from maipp.foresight.bumps import Bumps
from maipp.scenario import Scenario
from maipp.typing import Array, Float

# Fields drawn, which takes some 0.2 s; the factors are then known to about 2 %.
_DRAWS, _SEED = 3000, 2023
# Nodes of the quadrature over a bump's width, and the most points per side that fields are drawn at and compared at.
_NODES, _SIDE, _COMPARED = 4, 30, 10


def bumps_of(scenario: Scenario) -> Bumps:
    """The process of the scenario's family, which is worked out once."""
    numbers = scenario.mixture_components, scenario.mixture_variance, scenario.extent, min(scenario.grid, _SIDE)
    real = jnp.result_type(float)
    return Bumps(*(jnp.asarray(each, real) for each in _moments(*numbers)))


@lru_cache(maxsize=64)
def _moments(
    components: tuple[int, int], variance: tuple[float, float], extent: tuple[float, float], side: int
) -> tuple[np.ndarray, ...]:
    """The fields of `Bumps`."""
    widths, weights = widths_of(variance)
    axes = [np.linspace(0.0, length, side) for length in extent]
    fields = _draw(components, variance, axes).reshape(_DRAWS, -1)
    # A part of the grid is enough to compare at.
    some = np.unique(np.linspace(0, side - 1, _COMPARED).astype(int))
    index = (some[:, None] * side + some).reshape(-1)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)[index]
    unit = Bumps(*(jnp.asarray(each) for each in (widths, weights, 1.0, 1.0, 0.0, 1.0)))
    seen, shared = (np.asarray(each, np.float64) for each in _terms(unit, jnp.asarray(points), jnp.asarray(extent)))
    level = fields[:, index].mean(axis=0) @ seen / (seen @ seen)
    measured = np.cov(fields[:, index].T)
    terms = np.stack([shared.reshape(-1), np.outer(seen, seen).reshape(-1)], axis=1)
    (within, between), *_ = np.linalg.lstsq(terms, measured.reshape(-1), rcond=None)
    if within <= 0:  # so few bumps, or so wide ones, that all fields are nearly alike
        within, between = measured.mean() / shared.mean(), 0.0
    signal = np.diag(measured).mean()
    # Four digits: processors sum otherwise, and robots that plan together must have the same numbers.
    factors = (np.array(float(f"{factor:.4g}")) for factor in (level, within, between, signal))
    return widths, weights, *factors


def widths_of(variance: tuple[float, float]) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Widths and weights that stand for those of all bumps, whose squares are uniform within `variance`."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    low, high = np.sqrt(variance)
    widths = low + (high - low) * (nodes + 1) / 2
    # The density of a width is proportional to it.
    return widths, weights * widths / np.sum(weights * widths)


@jax.jit
def _terms(unit: Bumps, points: Float[Array, "n 2"], extent: Float[Array, "2"]) -> tuple[Array, Array]:
    """What the factors multiply at these points: of the mean, and of the covariance within a bump."""
    return unit.seen(points, extent), unit.covariance(points, points, extent)


def _draw(
    components: tuple[int, int], variance: tuple[float, float], axes: list[np.ndarray]
) -> Float[np.ndarray, "d x y"]:
    """Fields of the family, drawn as `sample_mixture` does, on the grid of these axes."""
    random, fields = np.random.default_rng(_SEED), []
    for count in random.integers(components[0], components[1] + 1, _DRAWS):
        centre = random.uniform(size=(count, 2)) * [axis[-1] for axis in axes]
        width = np.sqrt(random.uniform(*variance, (count, 2)))
        x, y = (
            np.exp(-0.5 * (axis - c[:, None]) ** 2 / w[:, None]) / w[:, None]
            for axis, c, w in zip(axes, centre.T, width.T, strict=True)
        )
        field = x.T @ y
        fields.append(field / field.max())
    return np.stack(fields)
