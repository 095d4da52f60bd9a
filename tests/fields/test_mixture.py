"""The Gaussian-mixture ground truth: the reference field, its grid, and the law it is drawn from."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from maipp.fields.mixture import GaussianMixture, evaluation_grid, sample_mixture

SEEDS = st.integers(0, 2**31 - 1)
draw = eqx.filter_jit(sample_mixture)


@pytest.fixture(scope="module")
def vectors():
    with np.load(Path(__file__).parents[1] / "data" / "gp_vectors.npz") as file:
        return dict(file)


@pytest.mark.parametrize("f", [0, 1, 2])
def test_matches_the_reference_field(vectors, f):
    with jax.enable_x64(True):
        np.testing.assert_allclose(evaluation_grid(), vectors["grid"], rtol=0, atol=1e-15)
        mixture = GaussianMixture(jnp.asarray(vectors[f"field{f}_mean"]), jnp.asarray(vectors[f"field{f}_sigma"]))
        assert float(mixture.maximum) == pytest.approx(float(vectors[f"field{f}_max"]), rel=1e-12)
        grid = mixture(jnp.asarray(vectors["grid"]))
        np.testing.assert_allclose(grid, vectors[f"field{f}_grid"].reshape(-1), rtol=0, atol=1e-12)
        measured = mixture(jnp.asarray(vectors[f"meas{f}_x"]))
        np.testing.assert_allclose(measured, vectors[f"meas{f}_y"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("f", [0, 1, 2])
def test_float32_is_close_to_the_reference_field(vectors, f):
    mean, sigma, grid = (jnp.asarray(vectors[k], jnp.float32) for k in (f"field{f}_mean", f"field{f}_sigma", "grid"))
    np.testing.assert_allclose(GaussianMixture(mean, sigma)(grid), vectors[f"field{f}_grid"].reshape(-1), atol=2e-5)


def test_grid_has_both_ends_and_x_slowest():
    grid = np.asarray(evaluation_grid(3, (2.0, 4.0)))
    np.testing.assert_allclose(grid[:4], [[0, 0], [0, 2], [0, 4], [1, 0]])
    np.testing.assert_allclose(grid[-1], [2, 4])


def test_absent_bumps_add_nothing():
    mean, sigma = jnp.array([[0.2, 0.3], [0.7, 0.6], [0.5, 0.5]]), jnp.full((3, 2), 0.01)
    padded = GaussianMixture(mean, sigma, present=jnp.array([True, True, False]))
    np.testing.assert_array_equal(padded(evaluation_grid()), GaussianMixture(mean[:2], sigma[:2])(evaluation_grid()))


@settings(max_examples=30)
@given(SEEDS)
def test_drawn_fields_obey_their_law(seed):
    extent = (2.0, 0.5)
    grid = evaluation_grid(12, extent)
    mixture = draw(jax.random.key(seed), components=(2, 5), variance=(1e-4, 4e-4), extent=extent, grid=grid)
    assert 2 <= int(mixture.present.sum()) <= 5
    assert ((np.asarray(mixture.mean) >= 0) & (np.asarray(mixture.mean) <= np.asarray(extent))).all()
    assert ((np.asarray(mixture.sigma) >= 0.01) & (np.asarray(mixture.sigma) <= 0.02)).all()
    truth = np.asarray(mixture(grid))
    assert truth.max() == pytest.approx(1.0, abs=1e-6)
    assert (truth >= 0).all()


def test_counts_centres_and_variances_are_uniform():
    """8..12 bumps, both included; centres uniform; the *square* of a bump's variance uniform (docs/protocol.md)."""
    grid = evaluation_grid(4)
    keys = jax.random.split(jax.random.key(0), 4000)
    drawn = jax.jit(jax.vmap(lambda key: sample_mixture(key, grid=grid)))(keys)
    counts = np.asarray(drawn.present.sum(axis=1))
    share = np.bincount(counts, minlength=13)[8:] / len(counts)
    np.testing.assert_allclose(share, 0.2, atol=0.03)  # 4.7 standard errors
    assert counts.max() == 12
    assert kstest(np.asarray(drawn.mean).ravel(), "uniform").pvalue > 1e-4
    assert kstest(((np.asarray(drawn.sigma, np.float64) ** 2 - 5e-5) / 1.5e-4).ravel(), "uniform").pvalue > 1e-4
