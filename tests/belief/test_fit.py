"""The kernel fitted to samples: scikit-learn's optimum, known parameters found again, units that make no difference."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from maipp.belief.fit import fit_kernel
from maipp.belief.fit_samples import farthest_first, thinned
from maipp.belief.likelihood import correlation, squared_differences
from maipp.errors import InputError


def draw(seed, count, *, length_scale=0.2, variance=2.0, noise=0.05, mean=7.0, stretch=(1.0, 1.0)):
    """Samples of a known kernel, uniform in the unit square; `stretch` divides the length scale along each axis."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(size=(count, 2))
    matrix = correlation(squared_differences(x * stretch, per_axis=False), np.array([length_scale]))[0]
    factor = np.linalg.cholesky(variance * matrix + noise * np.eye(count))
    return x, mean + factor @ rng.normal(size=count)


@pytest.mark.parametrize(("seed", "count"), [(0, 40), (1, 80), (2, 120)])
def test_it_is_scikit_learn_s_optimum(seed, count):
    x, y = draw(seed, count)
    ours = fit_kernel(x, y, mean=7.0)
    kernel = ConstantKernel(1.0, (1e-4, 1e4)) * Matern(0.3, (1e-2, 10.0), nu=1.5) + WhiteKernel(0.1, (1e-6, 1e2))
    theirs = GaussianProcessRegressor(kernel, alpha=0.0, n_restarts_optimizer=4, random_state=0).fit(x, y - 7.0)
    product, white = theirs.kernel_.k1, theirs.kernel_.k2  # pyright: ignore[reportAttributeAccessIssue]
    assert ours.log_marginal_likelihood >= theirs.log_marginal_likelihood_value_ - 1e-3
    assert ours.length_scale == pytest.approx(product.k2.length_scale, rel=0.01)
    assert ours.signal_variance == pytest.approx(product.k1.constant_value, rel=0.01)
    assert ours.noise_variance == pytest.approx(white.noise_level, rel=0.02, abs=2e-5)
    # And the value itself, where theirs is asked at our parameters.
    at = np.log([ours.signal_variance, ours.length_scale, ours.noise_variance])
    assert ours.log_marginal_likelihood == pytest.approx(theirs.log_marginal_likelihood(at), abs=1e-6)


def test_the_mean_is_the_generalised_least_squares_one():
    x, y = draw(3, 60)
    fit = fit_kernel(x, y)
    covariance = fit.signal_variance * correlation(squared_differences(x, False), np.array([fit.length_scale]))[0]
    covariance += fit.noise_variance * np.eye(60)
    weights = np.linalg.solve(covariance, np.ones(60))
    assert fit.mean == pytest.approx(weights @ y / weights.sum(), rel=1e-6)
    assert fit.mean_error == pytest.approx(weights.sum() ** -0.5, rel=1e-6)
    # No fixed mean is likelier.
    for other in (fit.mean - 0.5, fit.mean + 0.5):
        assert fit_kernel(x, y, mean=other).log_marginal_likelihood < fit.log_marginal_likelihood


def test_known_parameters_are_found_within_their_errors():
    """Over 24 draws the logs of the estimates scatter about the truth as much as their standard errors say."""
    truth = {"length_scale": 0.15, "signal_variance": 2.0, "noise_variance": 0.4}
    fits = [fit_kernel(*draw(seed, 120, length_scale=0.15, noise=0.4)) for seed in range(24)]
    for name, value in truth.items():
        found = np.array([getattr(fit, name) for fit in fits])
        errors = np.array([getattr(fit, f"{name}_error") for fit in fits], float) / found
        score = np.log(found / value) / errors
        assert abs(score.mean()) < 0.8, name  # 24 draws: standard error 0.2; maximum likelihood has a bias besides
        assert 0.6 < score.std() < 1.6, name
    mean = np.array([(fit.mean - 7.0) / fit.mean_error for fit in fits])
    assert abs(mean.mean()) < 0.8 and 0.6 < mean.std() < 1.6


@settings(max_examples=12)
@given(
    seed=st.integers(0, 1000),
    length=st.floats(1e-3, 1e6),
    value=st.floats(1e-6, 1e6),
    move=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
)
def test_units_and_origin_make_no_difference(seed, length, value, move):
    x, y = draw(seed, 30)
    plain = fit_kernel(x, y)
    moved = fit_kernel(length * (x + move[:2]), value * (y + move[2]))
    tolerance = 1e-4  # moving by a thousand takes three digits of the samples
    assert moved.length_scale == pytest.approx(length * plain.length_scale, rel=tolerance)
    assert moved.signal_variance == pytest.approx(value**2 * plain.signal_variance, rel=tolerance)
    assert moved.noise_variance == pytest.approx(value**2 * plain.noise_variance, rel=1e-2, abs=1e-6 * value**2)
    assert moved.mean == pytest.approx(value * (plain.mean + move[2]), rel=tolerance, abs=tolerance * value)
    likelihood = plain.log_marginal_likelihood - 30 * np.log(value)
    assert moved.log_marginal_likelihood == pytest.approx(likelihood, abs=1e-3)
    assert moved.on_bound == plain.on_bound


@pytest.mark.parametrize("fast", [0, 1])
def test_anisotropy_is_told(fast):
    stretch = (3.0, 1.0) if fast == 0 else (1.0, 3.0)
    x, y = draw(5, 150, length_scale=0.25, noise=0.01, stretch=stretch)
    fit = fit_kernel(x, y)
    assert fit.axis_length_scales is not None and fit.anisotropy_gain is not None
    assert fit.axis_length_scales[1 - fast] / fit.axis_length_scales[fast] == pytest.approx(3.0, rel=0.35)
    assert fit.anisotropy_gain > 10
    assert any(f"faster along {'xy'[fast]} than along {'yx'[fast]}" in words for words in fit.warnings)


def test_nothing_is_told_of_a_good_fit():
    fit = fit_kernel(*draw(0, 150))
    assert fit.warnings == () and fit.on_bound == () and fit.samples == fit.samples_given == 150
    assert fit.kernel.length_scale == fit.length_scale and fit.kernel.variance == fit.signal_variance


def test_doubts_are_told():
    rng = np.random.default_rng(0)
    x = rng.uniform(size=(60, 2))
    few = fit_kernel(*draw(0, 10))
    assert any("only 10 samples" in words for words in few.warnings)
    noise = fit_kernel(x, rng.normal(size=60))
    assert any("look like noise" in words or "Noise dominates" in words for words in noise.warnings)
    slope = fit_kernel(x, 3 * x[:, 0] + x[:, 1])
    assert "length_scale_high" in slope.on_bound and slope.length_scale_error is None
    assert any("upper limit" in words for words in slope.warnings)
    t = np.linspace(0, 1, 40)
    line = fit_kernel(np.stack([t, 2 * t], axis=1), np.sin(9 * t))
    assert line.axis_length_scales is None and any("one line" in words for words in line.warnings)
    mostly = fit_kernel(*draw(2, 150, noise=4.0))
    assert any("Noise dominates" in words for words in mostly.warnings)


def test_many_samples_are_thinned_by_place_and_told():
    x, y = draw(1, 300, noise=0.1)
    fit = fit_kernel(x, y, most=120)
    assert (fit.samples, fit.samples_given) == (120, 300)
    assert any("120 of the 300 samples" in words for words in fit.warnings)
    whole = fit_kernel(x, y)
    assert fit.length_scale == pytest.approx(whole.length_scale, rel=0.5)
    # Close pairs are kept: noise is still told from what changes over short distances.
    assert fit.noise_variance == pytest.approx(0.1, rel=0.6)


@given(seed=st.integers(0, 1000), count=st.integers(1, 60), most=st.integers(1, 60))
def test_thinning_keeps_a_spread_out_part(seed, count, most):
    x = np.random.default_rng(seed).uniform(size=(count, 2))
    keep = thinned(x, most)
    assert len(np.unique(keep)) == len(keep) <= most and (len(keep) == count) == (count <= most)
    order = farthest_first(x, count)
    assert sorted(order.tolist()) == list(range(count))
    distance = [np.sqrt(((x[order[i]] - x[order[:i]]) ** 2).sum(axis=1)).min() for i in range(1, count)]
    assert all(a >= b - 1e-12 for a, b in zip(distance, distance[1:], strict=False))


GOOD_X, GOOD_Y = draw(0, 8)


@pytest.mark.parametrize(
    ("x", "y", "problem"),
    [
        (GOOD_X[:4], GOOD_Y[:4], "4 are too few"),
        (np.ones((9, 2)), np.arange(9.0), "all in one place"),
        (np.repeat(GOOD_X[:3], 3, axis=0), np.arange(9.0), "in 3 places only"),
        (GOOD_X, np.full(8, 3.5), "every value is 3.5"),
        (GOOD_X, np.where(np.arange(8) == 2, np.nan, GOOD_Y), "number 2 .* value nan, 1 such"),
        (np.where(np.arange(8)[:, None] == 3, np.inf, GOOD_X), GOOD_Y, r"number 3 .*\(inf, inf\)"),
    ],
)
def test_samples_that_tell_nothing_are_refused(x, y, problem):
    with pytest.raises(InputError, match=problem) as caught:
        fit_kernel(x, y)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="mean: nan"):
        fit_kernel(GOOD_X, GOOD_Y, mean=float("nan"))


def test_the_result_is_plain_numbers():
    values = dataclasses.asdict(fit_kernel(*draw(0, 40)))
    assert all(type(value) in (float, int, str, tuple, type(None)) for value in values.values())
