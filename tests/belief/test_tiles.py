"""Tiles: every point is in one, a few measurements are all used, and of many the errors are small and one-sided."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.belief import Matern32, condition
from maipp.belief.tiles import survey_of, tile_index, tile_moments

SEEDS = st.integers(0, 2**32 - 1)
KERNEL = Matern32(0.25)
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 12)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)


@jax.jit
def both(x, y, mask):
    """Mean and variance by tiles, then exactly."""
    query = jnp.asarray(QUERY, x.dtype)
    exact = condition(KERNEL, x, y, mask, query, 1e-6)
    return (*tile_moments(KERNEL, survey_of(x, y, mask, 1e-6), query), exact.mean, exact.variance)


@pytest.mark.parametrize(("count", "side"), [(1, 1), (7, 2), (36, 3), (200, 7), (13, 4)])
def test_every_point_is_in_a_tile_of_neighbours(count, side):
    points = np.random.default_rng(count).random((count, 2))
    index = np.asarray(tile_index(jnp.asarray(points), side))
    assert index.shape == (side**2, -(-count // side**2))
    np.testing.assert_array_equal(np.unique(index), np.arange(count))
    strips = points[index, 0].reshape(side, -1)
    assert (strips.max(axis=1)[:-1] <= strips.min(axis=1)[1:]).all()


@settings(max_examples=10)
@given(SEEDS)
def test_a_few_measurements_give_the_exact_posterior(seed):
    rng = np.random.default_rng(seed)
    with jax.enable_x64(True):
        mean, variance, *exact = both(*map(jnp.asarray, (rng.random((200, 2)), rng.random(200), rng.random(200) < 0.7)))
        np.testing.assert_allclose(mean, exact[0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(variance, exact[1], rtol=0, atol=1e-8)


@settings(max_examples=10)
@given(SEEDS)
def test_of_many_measurements_the_variance_is_at_least_the_exact_one_and_near_it(seed):
    rng = np.random.default_rng(seed)
    with jax.enable_x64(True):
        x = rng.random((900, 2))
        y = np.sin(6 * x[:, 0]) * np.cos(5 * x[:, 1])
        mean, variance, *exact = map(np.asarray, both(*map(jnp.asarray, (x, y, np.ones(900, bool)))))
        assert (variance >= exact[1] - 1e-9).all()
        assert variance.sum() <= 1.02 * exact[1].sum()
        assert np.abs(mean - exact[0]).max() < 5e-3


def test_measurements_in_one_spot_stay_finite_in_float32():
    x = jnp.asarray(0.5 + 1e-6 * np.random.default_rng(0).normal(size=(900, 2)), jnp.float32)
    mean, variance, *_ = both(x, jnp.full(900, 0.7), jnp.ones(900, bool))
    assert jnp.isfinite(mean).all() and (variance >= 0).all() and (variance <= 1).all()
    here = int(np.argmin(np.linalg.norm(QUERY - 0.5, axis=1)))
    assert float(variance[here]) < 0.2 and float(mean[here]) > 0.6
