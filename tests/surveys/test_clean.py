"""Old samples: repeats count once, what cannot belong to the field is left out and named."""

import numpy as np
import pytest

from maipp.belief.fit import fit_kernel
from maipp.surveys.clean import Cleaned, fitted, merged, without_spikes


@pytest.fixture
def samples():
    rng = np.random.default_rng(7)
    x = rng.uniform(0, 1000, (60, 2))
    y = 10 + 3 * np.sin(x[:, 0] / 150) + 2 * np.cos(x[:, 1] / 220) + rng.normal(0, 0.2, 60)
    return x, y, np.arange(2, 62)


def test_repeats_count_once_with_their_mean(samples):
    x, y, lines = samples
    found = merged(np.repeat(x, 3, axis=0), np.repeat(y, 3) + np.tile([-1, 0, 1], 60), np.arange(180))
    np.testing.assert_array_equal(found.x, x)
    np.testing.assert_allclose(found.y, y)
    assert found.lines.tolist() == list(range(0, 180, 3))
    assert found.notes == ["120 of 180 lines repeat a place; each of the 60 places counts once"]
    assert merged(x, y, lines) == Cleaned(x, y, lines, [])


def test_spikes_are_named_by_their_lines_and_the_fit_is_that_of_the_rest(samples):
    x, y, lines = samples
    bad = y.copy()
    bad[[3, 40]] = 4500.0, 25.0
    found = without_spikes(Cleaned(x, bad, lines, []))
    assert found.notes == ["1 line (5) with 4500, far off all values nearby; left out"]
    found, fit = fitted(found, fit_kernel)
    assert found.notes[1:] == ["1 line (42) with 25, that the others contradict; left out"]
    rest = np.delete(np.arange(60), [3, 40])
    assert fit == fit_kernel(x[rest], y[rest])


def test_clean_samples_stay(samples):
    x, y, lines = samples
    found, fit = fitted(without_spikes(Cleaned(x, y, lines, [])), fit_kernel)
    assert found == Cleaned(x, y, lines, []) and fit == fit_kernel(x, y)


def test_where_too_few_would_be_left_all_stay():
    x = np.random.default_rng(1).uniform(0, 1, (6, 2))
    samples = Cleaned(x, np.array([1.0, 2, 1, 2, 1, 1e6]), np.arange(6), [])
    assert len(fitted(without_spikes(samples), fit_kernel)[0].y) >= 5
