"""Samples that do not belong to the field that the others are of: spikes, typing errors, a sensor out of the water."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import KDTree

from maipp.belief.kernel_fit import KernelFit
from maipp.belief.likelihood import correlation, squared_differences

# Neighbours that a sample is compared with, the bins of distance that tell how far values may differ, and fewest
# samples for that.
_NEIGHBOURS, _BINS, _FEWEST = 8, 6, 12
# Typical differences that a spike is away from most of its neighbours: of clean draws of a Gaussian process fewer than
# 1 in 1,000 samples is so far (tests/belief/test_outliers.py).
_SPIKE = 12.0
_NORMAL = 0.6745  # median of |z| for a standard normal z


def spikes(x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Which samples differ from most of their neighbours by far more than is usual over such distances.

    What is usual is the median difference in each of several bins of distance (a robust variogram: Cressie & Hawkins
    1980), so that a tenth of bad samples does not hide itself. All False for fewer than 12 samples.
    """
    if len(y) < _FEWEST:
        return np.zeros(len(y), bool)
    distance, index = KDTree(x).query(x, k=min(_NEIGHBOURS + 1, len(y)))
    distance, other = np.asarray(distance)[:, 1:], np.asarray(index)[:, 1:]
    difference = np.abs(y[:, None] - y[other])
    edges = np.quantile(distance, np.linspace(0, 1, _BINS + 1)[1:-1])
    bin_of = np.searchsorted(edges, distance)
    usual = np.array([np.median(difference[bin_of == b]) if (bin_of == b).any() else 0.0 for b in range(_BINS)])
    # Values differ no less over longer distances; and never less than they are rounded to.
    usual = np.maximum.accumulate(usual) / _NORMAL
    steps = np.diff(np.unique(y))
    usual = np.maximum(usual, steps.min() if len(steps) else 1.0)
    return np.asarray(np.median(difference / usual[bin_of], axis=1) > _SPIKE)


def surprises(x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], fit: KernelFit) -> Float[np.ndarray, " n"]:
    """How many standard deviations each sample is from what all others lead to expect under a fitted kernel.

    Source: Rasmussen & Williams 2006, Sec. 5.4.2 (leave-one-out).
    """
    matrix, _, _ = correlation(squared_differences(x, per_axis=False), np.array([fit.length_scale]))
    matrix *= fit.signal_variance
    # As in the search: what is singular in float64 gets a little noise.
    matrix[np.diag_indices(len(y))] += max(fit.noise_variance, 1e-8 * fit.signal_variance)
    factor = cho_factor(matrix, lower=True, check_finite=False)
    inverse = np.diag(cho_solve(factor, np.eye(len(y)), check_finite=False))
    return np.asarray(cho_solve(factor, y - fit.mean, check_finite=False) / np.sqrt(inverse))
