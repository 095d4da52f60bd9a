"""The moments of the field family, and the Gaussian process that has them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.belief import Matern32, condition
from maipp.engine import draw_missions
from maipp.fields.mixture import evaluation_grid
from maipp.foresight.bump_moments import bumps_of, widths_of
from maipp.foresight.bumps import Bumps
from maipp.scenario import Scenario

# Not square, wide bumps beside narrow ones, and places at the border.
EXTENT = (1.6, 0.7)
LOW, HIGH = 2e-5, 4e-4
SIDE = 6
GRID = np.asarray(evaluation_grid(SIDE, EXTENT), np.float64)
FAMILY = Scenario(extent=EXTENT, mixture_variance=(LOW, HIGH), mixture_components=(3, 9), grid=SIDE)


@jax.jit
def moments(process, points):
    """Mean and covariance at points, each compiled once."""
    return process.mean(points, EXTENT), process.covariance(points, points, EXTENT)


@jax.jit
def given(process, x, y, extra, mask):
    """The law and its evidence, and the law as if the grid were any points."""
    belief = condition(Matern32(0.3), x, y, mask, jnp.asarray(GRID, jnp.float32), 1e-4, extra)
    return process.given(belief, EXTENT, SIDE), process.given(belief, EXTENT, None).law


def test_the_closed_form_is_what_draws_of_bumps_have():
    """Sums that are not divided by their maximum, whose factors are known: no number is fitted here.

    Off by at most five standard errors of the draws, each moment by its own: of 36 means and 666 covariances one in
    2,000 such comparisons would fail by chance.
    """
    rng, draws = np.random.default_rng(3), 20_000
    count = rng.integers(3, 10, draws)
    centre = rng.uniform(size=(draws, 9, 2)) * EXTENT
    width = np.sqrt(rng.uniform(LOW, HIGH, (draws, 9, 2)))
    there = np.arange(9) < count[:, None]
    values = np.empty((draws, len(GRID)))
    for begin in range(0, draws, 4000):
        part = slice(begin, begin + 4000)
        offset = GRID - centre[part][:, :, None]
        bumps = np.exp(-0.5 * (offset**2 / width[part][:, :, None]).sum(axis=-1))
        bumps /= width[part].prod(axis=-1)[..., None]
        values[part] = (bumps * there[part][..., None]).sum(axis=1)
    # The closed form leaves out sqrt(2 pi) a bump and axis in the mean, and sqrt(pi) a pair in the covariance.
    mean, within = 6 * 2 * np.pi, 6 * np.pi
    numbers = (*widths_of((LOW, HIGH)), mean, within, (4 - 6) * (2 * np.pi) ** 2, 1.0)
    process = Bumps(*(jnp.asarray(each, jnp.float32) for each in numbers))
    expected, covariance = moments(process, jnp.asarray(GRID, jnp.float32))
    error = values.std(axis=0) / draws**0.5
    assert (np.abs(values.mean(axis=0) - expected) < 5 * error).all()
    deviations = values - values.mean(axis=0)
    products = deviations[:, :, None] * deviations[:, None]
    error = products.std(axis=0) / draws**0.5
    assert (np.abs(products.mean(axis=0) - covariance) < 5 * error).all()


def test_fitted_to_the_scenario_s_fields_it_has_their_moments():
    """Dividing by the maximum changes mean and covariance by more than a factor, but little: by 5 and 15 % here."""
    missions = draw_missions(FAMILY, seed=5, instances=2000, roadmaps=False)
    fields, process = np.asarray(missions.truth, np.float64), bumps_of(FAMILY)
    mean, covariance = fields.mean(axis=0), np.cov(fields.T)
    expected, found = moments(process, jnp.asarray(GRID, jnp.float32))
    assert np.linalg.norm(expected - mean) < 0.08 * np.linalg.norm(mean)
    assert np.linalg.norm(found - covariance) < 0.25 * np.linalg.norm(covariance)
    assert float(process.signal) == pytest.approx(np.diag(covariance).mean(), rel=0.1)


def test_given_measurements_it_is_the_gaussian_process_of_a_textbook():
    """In float64 by NumPy; float32 and the same nugget leave 1e-3 of the field's deviation and 1e-2 of the evidence."""
    rng, count = np.random.default_rng(1), 12
    x = rng.uniform(size=(16, 2)) * EXTENT
    y = rng.uniform(0, 1, 16)
    mask = np.arange(16) < count
    extra = rng.uniform(0, 0.01, 16)
    process = bumps_of(FAMILY)
    (law, evidence), anywhere = given(process, *(jnp.asarray(each, jnp.float32) for each in (x, y, extra)), mask)
    np.testing.assert_allclose(law.mean, anywhere.mean, atol=1e-5)
    np.testing.assert_allclose(law.deviation, anywhere.deviation, atol=1e-4)

    x, y, signal = x[:count], y[:count], float(process.signal)
    both = jnp.asarray(np.concatenate([x, GRID]), jnp.float32)
    mean, covariance = (np.asarray(each, np.float64) for each in moments(process, both))
    gram = covariance[:count, :count] + np.diag(1e-4 + extra[:count] + 1e-4 * signal)
    cross, surprise = covariance[:count, count:], y - mean[:count]
    expected = mean[count:] + cross.T @ np.linalg.solve(gram, surprise)
    variance = np.diag(covariance)[count:] - np.sum(cross * np.linalg.solve(gram, cross), axis=0)
    np.testing.assert_allclose(law.mean, expected, atol=1e-3 * signal**0.5)
    np.testing.assert_allclose(law.deviation, np.sqrt(np.maximum(variance, 0)), atol=5e-3 * signal**0.5)
    _, logdet = np.linalg.slogdet(2 * np.pi * gram)
    assert float(evidence) == pytest.approx(-0.5 * (surprise @ np.linalg.solve(gram, surprise) + logdet), abs=0.01)
