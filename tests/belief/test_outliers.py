"""Samples that do not belong to the field of the others are found; clean ones are left alone."""

import numpy as np
import pytest
from scipy.stats import kstest

from maipp.belief.fit import fit_kernel
from maipp.belief.outliers import spikes, surprises


def matern(x, scale):
    s = np.sqrt(3 * ((x[:, None] - x[None]) ** 2).sum(-1)) / scale
    return (1 + s) * np.exp(-s)


def draw(rng, x, scale, noise):
    return 10 + 2 * np.linalg.cholesky(matern(x, scale) + (noise**2 + 1e-9) * np.eye(len(x))) @ rng.normal(size=len(x))


def places(rng, kind, count):
    if kind == "track":
        along = 8 * np.linspace(0, 1, count)
        return np.stack([along % 1, np.floor(along) / 8], axis=-1)
    return rng.uniform(0, 1, (count, 2))


@pytest.mark.parametrize("kind", ["scattered", "track"])
def test_of_clean_samples_hardly_one_is_a_spike(kind):
    rng, found, count = np.random.default_rng(3), 0, 0
    for scale in (0.05, 0.15, 0.45, 1.0):
        for noise in (0.0, 0.05, 0.3):
            x = places(rng, kind, 200)
            found, count = found + spikes(x, draw(rng, x, scale, noise)).sum(), count + 200
    assert found <= count / 1000  # and none with this seed


@pytest.mark.parametrize("share", [0.01, 0.1])
@pytest.mark.parametrize("kind", ["scattered", "track"])
def test_spikes_are_found_and_their_neighbours_are_not(kind, share):
    rng = np.random.default_rng(4)
    x = places(rng, kind, 200)
    y = draw(rng, x, 0.3, 0.05)
    bad = rng.random(200) < share
    y[bad] += 100 * rng.choice([-1, 1], bad.sum())
    found = spikes(x, y)
    assert found[bad].all() and found[~bad].mean() <= 0.02


def test_units_change_nothing():
    rng = np.random.default_rng(5)
    x = places(rng, "scattered", 60)
    y = draw(rng, x, 0.3, 0.05)
    y[7] = 99.0
    assert np.flatnonzero(spikes(x, y)).tolist() == np.flatnonzero(spikes(x * 1000 + 5, -y * 1e6 + 3)).tolist() == [7]


@pytest.mark.parametrize("y", [np.zeros(11), np.full(20, 3.0), np.arange(20.0), np.r_[np.zeros(19), 5.0]])
def test_few_and_constant_values_are_no_trouble(y):
    assert not spikes(np.arange(2.0 * len(y)).reshape(-1, 2), y).any()


def test_surprises_are_those_of_leaving_one_out():
    """Against the definition; and standard normal for samples of the kernel itself."""
    rng = np.random.default_rng(6)
    x = places(rng, "scattered", 80)
    y = draw(rng, x, 0.3, 0.2)
    fit = fit_kernel(x, y)
    found = surprises(x, y, fit)
    k = fit.signal_variance * matern(x, fit.length_scale) + fit.noise_variance * np.eye(80)
    for i in (0, 33, 79):
        rest = np.arange(80) != i
        weights = np.linalg.solve(k[rest][:, rest], k[rest, i])
        mean, variance = fit.mean + weights @ (y[rest] - fit.mean), k[i, i] - weights @ k[rest, i]
        assert found[i] == pytest.approx((y[i] - mean) / np.sqrt(variance), rel=1e-6)
    assert kstest(found, "norm").pvalue > 0.01
