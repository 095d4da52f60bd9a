"""The likelihood: its gradient, its closed-form mean and variance, its information, against plain formulas."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import multivariate_normal
from sklearn.gaussian_process.kernels import Matern

from maipp.belief.likelihood import best_ratio, correlation, information, profile_likelihood, squared_differences

RNG = np.random.default_rng(0)
X, Y = RNG.uniform(size=(25, 2)), RNG.normal(size=25)


@pytest.mark.parametrize("scales", [(0.3,), (0.3, 0.8)])
def test_correlations_are_scikit_learn_s(scales):
    ours = correlation(squared_differences(X, per_axis=len(scales) > 1), np.array(scales))[0]
    theirs = Matern(scales[0] if len(scales) == 1 else scales, nu=1.5)(X)
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)


@pytest.mark.parametrize("mean", [None, 0.3])
@pytest.mark.parametrize("scales", [(0.3,), (0.3, 0.8)])
def test_gradient_and_value(scales, mean):
    squared = squared_differences(X, per_axis=len(scales) > 1)
    parameters = np.log([*scales, 0.2])
    found = profile_likelihood(parameters, squared, Y, mean)
    slope = approx_fprime(parameters, lambda p: profile_likelihood(p, squared, Y, mean).value, 1e-6)
    np.testing.assert_allclose(found.gradient, slope, rtol=1e-4, atol=1e-5)
    covariance = found.variance * (correlation(squared, np.array(scales))[0] + 0.2 * np.eye(25))
    assert found.value == pytest.approx(multivariate_normal(np.full(25, found.mean), covariance).logpdf(Y))
    # The closed forms are the best there is.
    for factor in (0.9, 1.1):
        assert multivariate_normal(np.full(25, found.mean), factor * covariance).logpdf(Y) < found.value
    if mean is None:
        for move in (-0.1, 0.1):
            assert multivariate_normal(np.full(25, found.mean + move), covariance).logpdf(Y) < found.value
        assert found.variance * found.mean_factor == pytest.approx(1 / np.linalg.inv(covariance).sum())


@pytest.mark.parametrize("mean", [None, 0.3])
def test_one_decomposition_serves_all_ratios(mean):
    squared = squared_differences(X, per_axis=False)
    ratios = np.log([0.01, 0.1, 1.0, 10.0])
    values = [profile_likelihood(np.array([-1.0, ratio]), squared, Y, mean).value for ratio in ratios]
    value, ratio = best_ratio(-1.0, squared, Y, ratios, mean)
    assert value == pytest.approx(max(values)) and ratio == ratios[int(np.argmax(values))]


def test_information_is_the_expected_curvature():
    """The mean over draws of the outer product of the gradient, which is what the information is."""
    squared = squared_differences(X, per_axis=False)
    log = np.log([0.3, 1.5, 0.2])

    def covariance(p):
        return np.exp(p[1]) * correlation(squared, np.exp(p[:1]))[0] + np.exp(p[2]) * np.eye(25)

    inverse = np.linalg.inv(covariance(log))
    steps = 1e-5 * np.eye(3)
    slopes = [(covariance(log + step) - covariance(log - step)) / 2e-5 for step in steps]
    expected = [[0.5 * np.trace(inverse @ a @ inverse @ b) for b in slopes] for a in slopes]
    np.testing.assert_allclose(information(squared, 0.3, 1.5, 0.2), expected, rtol=1e-6)
