"""The variogram against a plain double loop, and the profile against the fit."""

import numpy as np
import pytest

from maipp.belief.fit import fit_kernel
from maipp.belief.fit_profile import likelihood_profile
from maipp.belief.variogram import empirical_variogram

RNG = np.random.default_rng(0)
X = RNG.uniform(0, 10, size=(40, 2))
Y = np.sin(X[:, 0]) + 0.1 * RNG.normal(size=40)


def test_each_bin_is_the_mean_over_its_pairs():
    found = empirical_variogram(X, Y, bins=6, farthest=5.0)
    pairs = [(np.hypot(*(X[i] - X[j])), 0.5 * (Y[i] - Y[j]) ** 2) for i in range(40) for j in range(i)]
    edges = np.linspace(0, 5, 7)
    rows = [[p for p in pairs if low <= p[0] < high] for low, high in zip(edges, edges[1:], strict=False)]
    rows = [row for row in rows if row]
    assert found.pairs.tolist() == [len(row) for row in rows]
    np.testing.assert_allclose(np.transpose([found.distance, found.semivariance]), [np.mean(row, 0) for row in rows])


def test_bins_without_pairs_are_left_out():
    apart = np.array([[0.0, 0.0], [0.1, 0.0], [10.0, 0.0], [10.1, 0.0], [5.0, 0.0]])
    found = empirical_variogram(apart, np.arange(5.0), bins=10)
    assert found.pairs.sum() == sum(np.hypot(*(apart[i] - apart[j])) <= 5.05 for i in range(5) for j in range(i))
    assert (found.pairs > 0).all() and len(found.pairs) == 2


def test_the_profile_is_highest_at_the_fit():
    fit = fit_kernel(X, Y)
    found = likelihood_profile(X, Y, also=fit.length_scale)
    best = found.length_scale[int(np.argmax(found.log_likelihood))]
    assert best == pytest.approx(fit.length_scale) and found.log_likelihood.max() == 0.0
    assert found.samples == 40 and len(found.length_scale) == 31
    assert (np.diff(found.length_scale) > 0).all()
    # The profile is that of the whole likelihood: with the length scale pushed aside it falls.
    assert found.log_likelihood[0] < -1.92
