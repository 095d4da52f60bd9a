"""The kernel that measurements tell under way: the posterior that is searched, and what is found where it is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from maipp.belief import refit as module
from maipp.belief.refit import Hyperparameters, HyperPrior, refit

NOISE = 1e-3
PRIOR = HyperPrior(0.45, NOISE)


def draw(seed, kernel, count):
    """A field with a kernel, measured along wandering ways."""
    rng = np.random.default_rng(seed)
    x = np.clip(np.cumsum(rng.normal(0, 0.1, (3, count // 3, 2)), axis=1) + rng.uniform(0, 1, (3, 1, 2)), -0.5, 1.5)
    x = x.reshape(-1, 2)
    s = np.sqrt(3 * ((((x[:, None] - x) @ kernel.warp) ** 2).sum(axis=-1))) / kernel.length_scale
    covariance = kernel.std**2 * (1 + s) * np.exp(-s) + kernel.noise * np.eye(len(x))
    return x, rng.multivariate_normal(np.full(len(x), kernel.mean), covariance, method="cholesky")


@settings(max_examples=20)
@given(st.floats(-2, 0), st.floats(-6, 0), st.floats(-1, 1), st.floats(-3, 3), st.booleans(), st.integers(0, 2**32 - 1))
def test_slope_is_that_of_finite_differences(scale, ratio, half, direction, isotropic, seed):
    rng = np.random.default_rng(seed)
    data = module._Data(rng.uniform(size=(12, 2)), rng.normal(size=12), rng.uniform(0.5, 2, 12), PRIOR)
    at = np.array([scale, ratio] if isotropic else [scale, ratio, half, direction])
    # Central differences of a value of some 10 with steps of 1e-6 keep nine digits of it.
    slope = [(data(at + step)[0] - data(at - step)[0]) / 2e-6 for step in 1e-6 * np.eye(len(at))]
    np.testing.assert_allclose(data(at)[1], slope, rtol=1e-5, atol=1e-5)


def test_posterior_is_the_product_of_its_parts():
    """The mean integrated out, the signal variance at its most likely: differences to what SciPy says are constant."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(size=(15, 2)), rng.normal(0.5, 1, 15)
    data = module._Data(x, y, np.ones(15), PRIOR)
    logs = np.linspace(-4, 4, 40001)  # of the variance; a step moves the maximum by at most 1e-8
    apart = []
    for scale, ratio in ((0.2, 1e-2), (0.5, 1e-3), (1.0, 0.3)):
        s = np.sqrt(3 * ((x[:, None] - x) ** 2).sum(axis=-1)) / scale
        shape = (1 + s) * np.exp(-s) + ratio * np.eye(15) + module._LEVEL**2
        unit = multivariate_normal(np.zeros(15), shape)
        squares = float(y @ np.linalg.solve(shape, y))
        # log N(y; 0, v K) = log N(y; 0, K) + (y'K^-1 y) (1 - 1 / v) / 2 - n log(v) / 2
        likelihood = unit.logpdf(y) + 0.5 * squares * (1 - np.exp(-logs)) - 7.5 * logs
        inverse_gamma = -PRIOR.weight * logs - PRIOR.weight * PRIOR.std**2 * np.exp(-logs)
        known = -0.5 * (np.log(scale / 0.45) / PRIOR.scale_spread) ** 2
        known += -0.5 * (np.log(ratio / NOISE) / PRIOR.noise_spread) ** 2
        apart.append(data(np.log([scale, ratio]))[0] + (likelihood + inverse_gamma).max() + known)
    np.testing.assert_allclose(apart, apart[0], atol=1e-6)


@pytest.mark.parametrize("guess", [0.15, 0.45])
@pytest.mark.parametrize("true", [0.15, 0.3, 0.6])
def test_a_wrong_length_scale_is_mended(true, guess):
    found = [
        refit(*draw(seed, Hyperparameters(0.0, 1.0, true, NOISE), 45), HyperPrior(guess, NOISE)).length_scale
        for seed in range(12)
    ]
    # Of 60 draws the median of what 45 measurements tell was within 20 %; 12 draws spread by a third of one's spread.
    assert np.median(found) == pytest.approx(true, rel=0.3)


def test_of_nothing_known_the_level_and_the_size_are_found():
    prior = HyperPrior(0.45, 0.0025, weight=0.01, level_known=False, noise_spread=1.5)
    x, y = draw(1, Hyperparameters(0.0, 1.0, 0.3, NOISE), 45)
    base = refit(x, y, prior)
    far = refit(x, 300.0 + 40.0 * y, prior)
    # The guess of 1 is worth 0.02 measurements of 45.
    assert far.std == pytest.approx(40 * base.std, rel=1e-2) and far.mean == pytest.approx(300 + 40 * base.mean, abs=1)
    assert far.length_scale == pytest.approx(base.length_scale, rel=2e-2)


def test_few_measurements_leave_the_guess():
    x, y = draw(2, Hyperparameters(0.0, 1.0, 0.3, NOISE), 45)
    assert refit(x[:5], y[:5], PRIOR) == PRIOR.guess == Hyperparameters(0.0, 1.0, 0.45, NOISE)


def test_a_field_with_a_direction_is_told_from_one_without():
    streaks = Hyperparameters(0.0, 1.0, 0.3, NOISE, aspect=4.0, direction=0.6)
    found = [refit(*draw(seed, streaks, 150), PRIOR) for seed in range(4)]
    assert all(each.aspect > 2 for each in found)
    np.testing.assert_allclose([each.direction for each in found], 0.6, atol=0.2)
    alike = [refit(*draw(seed, streaks._replace(aspect=1.0), 60), PRIOR).aspect for seed in range(12)]
    assert alike == [1.0] * 12  # the gain asked for is beyond the 99th percentile


def test_from_what_was_found_before_the_same_is_found():
    x, y = draw(4, Hyperparameters(0.0, 1.0, 0.25, NOISE), 120)
    before = refit(x[:100], y[:100], PRIOR)
    one, other = refit(x, y, PRIOR), refit(x, y, PRIOR, before=before)
    # Both searches end where the posterior changes by less than a millionth.
    assert one.length_scale == pytest.approx(other.length_scale, rel=2e-2)
    assert one.std == pytest.approx(other.std, rel=2e-2)


def test_noisier_ones_count_less():
    x, y = draw(5, Hyperparameters(0.0, 1.0, 0.3, NOISE), 45)
    factors = np.where(np.arange(45) % 3 == 0, 1000.0, 1.0)
    wild = y + np.random.default_rng(0).normal(0, 1, 45) * (factors > 1)
    assert refit(x, wild, PRIOR, factors).length_scale == pytest.approx(0.3, rel=0.4)
    assert refit(x, wild, PRIOR).length_scale < 0.15
