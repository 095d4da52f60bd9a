"""Draws of a Gaussian process: their mean and covariance are the exact posterior's, and they pass the samples."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

import maipp
from maipp.belief import Matern32
from maipp.errors import InputError
from maipp.fields.gp_field import draw_fields

KERNEL = Matern32(0.3, 2.0)
NOISE = 0.05
DRAWS = 4000
POINTS = np.array([[0.1, 0.2], [0.15, 0.25], [0.5, 0.5], [0.9, 0.8], [0.42, 0.61], [1.4, 0.1]])
X = np.array([[0.12, 0.22], [0.5, 0.52], [0.45, 0.6], [0.8, 0.2]])
Y = np.array([3.0, 1.2, 0.9, -0.5])


def evaluated(fields, points=POINTS):
    return np.asarray(jax.jit(jax.vmap(lambda field: field(jnp.asarray(points))))(fields), np.float64)


def exact(x, y):
    """Posterior mean and covariance at the points, by scikit-learn."""
    kernel = ConstantKernel(2.0, "fixed") * Matern(0.3, "fixed", nu=1.5)
    no_search: Any = None
    regressor = GaussianProcessRegressor(kernel, alpha=NOISE, optimizer=no_search)
    if len(y):
        regressor.fit(x, y - 1.0)
    predicted: Any = regressor.predict(POINTS, return_cov=True)
    mean, covariance = predicted
    return mean + 1.0, covariance


@pytest.mark.parametrize("count", [0, 4])
def test_mean_and_covariance_are_the_exact_posterior_s(count):
    samples = {"x": X, "y": Y} if count else {}
    fields = draw_fields(jax.random.key(0), KERNEL, DRAWS, mean=1.0, noise=NOISE, waves=128, **samples)
    values = evaluated(fields)
    mean, covariance = exact(X[:count], Y[:count])
    variance = np.diag(covariance)
    assert np.abs((values.mean(axis=0) - mean) / np.sqrt(variance / DRAWS)).max() < 4.0
    found = np.cov(values.T)
    # Standard error of a sample covariance of normal variables.
    errors = np.sqrt((variance[:, None] * variance[None, :] + covariance**2) / DRAWS)
    assert np.abs((found - covariance) / errors).max() < 4.5


def test_draws_pass_the_samples_within_their_noise():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(size=(300, 2)), rng.normal(size=300)
    exactly = draw_fields(jax.random.key(1), KERNEL, 3, mean=1.0, x=x[:60], y=y[:60], noise=0.0)
    np.testing.assert_allclose(evaluated(exactly, x[:60]), np.broadcast_to(y[:60], (3, 60)), atol=0.01)
    # Away from the samples the draws differ.
    assert evaluated(exactly, POINTS[-1:]).std() > 0.3
    # With noise the residuals are those of the exact posterior: far below the values' own scatter of 1.
    truth = np.sin(6 * x[:, 0]) + x[:, 1]
    noisy = draw_fields(jax.random.key(1), KERNEL, 40, x=x, y=truth + 0.1 * y, noise=0.01)
    assert np.sqrt(((evaluated(noisy, x) - truth) ** 2).mean()) < 0.1


def test_a_draw_is_the_same_whatever_their_number():
    some, more = (draw_fields(jax.random.key(3), KERNEL, n, x=X, y=Y, noise=NOISE, waves=64) for n in (2, 5))
    np.testing.assert_allclose(evaluated(some), evaluated(more)[:2], rtol=1e-5, atol=1e-5)
    other = draw_fields(jax.random.key(4), KERNEL, 2, x=X, y=Y, noise=NOISE, waves=64)
    assert np.abs(evaluated(other) - evaluated(some)).max() > 0.1


def test_one_draw_looks_like_the_kernel_over_its_area():
    """The mean product of values a given distance apart, over a domain of many length scales."""
    field = jax.tree.map(lambda leaf: leaf[0], draw_fields(jax.random.key(5), Matern32(0.1, 1.0), 1))
    at = np.random.default_rng(1).uniform(0, 20, size=(20000, 2))
    near = np.asarray(field(jnp.asarray(at, jnp.float32)))
    for distance in (0.05, 0.2):
        beside = np.asarray(field(jnp.asarray(at + [distance, 0.0], jnp.float32)))
        s = 3**0.5 * distance / 0.1
        assert (near * beside).mean() == pytest.approx((1 + s) * np.exp(-s), abs=0.08)


def test_a_survey_runs_on_them():
    scenario = maipp.Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)
    planner = maipp.make_planner("random", scenario)
    missions = maipp.draw_missions(scenario, seed=0, instances=3)
    fields = draw_fields(jax.random.key(0), Matern32(0.45), 3, x=X, y=Y, noise=NOISE, waves=64)
    truth = jax.vmap(lambda field, grid: field(grid))(fields, missions.grid)
    missions = dataclasses.replace(missions, field=fields, truth=truth)
    states = maipp.run_missions(planner, missions, jax.random.key(0))
    taken = np.isfinite(np.asarray(states.measurement_time))
    for i in range(3):
        field = jax.tree.map(lambda leaf, i=i: leaf[i], fields)
        at, value = states.measurement_x[i][taken[i]], states.measurement_y[i][taken[i]]
        assert len(value) == 6
        np.testing.assert_allclose(np.asarray(field(at)), np.asarray(value), atol=1e-4)


def test_many_samples_are_thinned_and_bad_ones_refused():
    rng = np.random.default_rng(0)
    x = rng.uniform(size=(2100, 2))
    fields = draw_fields(jax.random.key(0), KERNEL, 1, x=x, y=x[:, 0], noise=0.01, waves=64)
    assert fields.samples.shape == (1, 2000, 2)
    assert np.sqrt(((evaluated(fields, x)[0] - x[:, 0]) ** 2).mean()) < 0.06
    with pytest.raises(InputError, match="noise: -1"):
        draw_fields(jax.random.key(0), KERNEL, 1, noise=-1.0)
    with pytest.raises(InputError, match="give both x and y"):
        draw_fields(jax.random.key(0), KERNEL, 1, x=X)
