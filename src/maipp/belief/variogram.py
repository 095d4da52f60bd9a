"""The empirical variogram of samples: how different values are, on average, a distance apart."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.distance import pdist

from maipp.belief.fit_samples import thinned

# Of more samples a part is taken, by place: their pairs grow with the square.
_MOST_SAMPLES = 2000


class Variogram(NamedTuple):
    """Half the mean squared difference of the values of pairs, by their distance."""

    distance: Float[np.ndarray, " k"]  # mean distance of the pairs in each bin, units of the positions
    semivariance: Float[np.ndarray, " k"]  # squared units of the values
    pairs: Int[np.ndarray, " k"]  # how many pairs each bin has, one at least


def empirical_variogram(
    x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], *, bins: int = 15, farthest: float | None = None
) -> Variogram:
    """The variogram in `bins` bins of equal width up to `farthest` (default: half the largest distance); bins without
    pairs are left out.

    Beyond half the largest distance pairs come from the margins only, and say little. Source: Matheron 1963 (the
    classical estimator).
    """
    keep = thinned(np.asarray(x, np.float64), _MOST_SAMPLES)
    distance = pdist(np.asarray(x, np.float64)[keep])
    half = 0.5 * pdist(np.asarray(y, np.float64)[keep][:, None], "sqeuclidean")
    end = 0.5 * distance.max() if farthest is None else farthest
    near = distance <= end
    cell = np.minimum((distance[near] * (bins / end)).astype(int), bins - 1)
    count = np.bincount(cell, minlength=bins)
    some = count > 0
    sums = (np.bincount(cell, weights=values, minlength=bins)[some] for values in (distance[near], half[near]))
    mean_distance, semivariance = (total / count[some] for total in sums)
    return Variogram(mean_distance, semivariance, count[some])
