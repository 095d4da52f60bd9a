"""Samples fit for fitting: checked, in one order, and few enough to factor their covariance."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from maipp.errors import InputError

FEWEST = 5  # samples and places below which nothing can be told of a kernel

# Of the samples kept, the part that is spread as far as possible; the rest are the nearest neighbours of these,
# without which there would be no close pairs and noise could not be told from what changes over short distances.
_SPREAD = 0.75


class CheckedSamples(NamedTuple):
    """Samples of which a kernel can be fitted."""

    x: Float[np.ndarray, "n 2"]  # positions, any unit of length, the same for both axes
    y: Float[np.ndarray, " n"]  # values, any unit
    given: int  # samples there were before thinning


def checked_samples(x: np.ndarray, y: np.ndarray, most: int) -> CheckedSamples:
    """The samples in float64, thinned to at most `most`.

    Raises InputError for shapes other than (n, 2) and (n,), numbers that are not finite, fewer than 5 samples or
    places, and values that are all the same.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if x.ndim != 2 or x.shape[1] != 2 or y.shape != x.shape[:1]:
        raise InputError(f"samples: positions of shape {x.shape} and values of shape {y.shape}; give (n, 2) and (n,)")
    if len(y) < FEWEST:
        raise InputError(f"samples: {len(y)} are too few to fit a kernel to; give at least {FEWEST}, better 30 or more")
    bad = np.flatnonzero(~(np.isfinite(x).all(axis=1) & np.isfinite(y)))
    if len(bad):
        i = int(bad[0])
        raise InputError(
            f"samples: number {i} (counting from 0) is ({x[i, 0]:g}, {x[i, 1]:g}) with value {y[i]:g}, "
            f"{len(bad)} such in all; leave out what is not finite"
        )
    places = len(np.unique(x, axis=0))
    if places < FEWEST:
        where = "all in one place" if places == 1 else f"in {places} places only"
        raise InputError(f"samples: {len(y)} of them, {where}; a length scale needs at least {FEWEST} places")
    if y.min() == y.max():
        raise InputError(f"samples: every value is {y[0]:g}; a kernel cannot be fitted to values that are all the same")
    keep = thinned(x, most)
    return CheckedSamples(x[keep], y[keep], len(y))


def thinned(x: Float[np.ndarray, "n 2"], most: int) -> Int[np.ndarray, " k"]:
    """Indices of at most `most` of the points: three quarters in farthest-point order, then close neighbours of these.

    All of them, in their own order, where there are no more. The choice depends on the places only, so what is fitted
    to the values is not biased by it.
    """
    if len(x) <= most:
        return np.arange(len(x))
    spread = farthest_first(x, max(1, round(_SPREAD * most)))
    left = np.ones(len(x), bool)
    left[spread] = False
    others = np.flatnonzero(left)
    nearest = np.asarray(KDTree(x[others]).query(x[spread])[1])
    # Two may have the same neighbour; the others in line fill up.
    beside = others[list(dict.fromkeys(nearest.tolist()))][: most - len(spread)]
    return np.concatenate([spread, beside])


def farthest_first(x: Float[np.ndarray, "n 2"], count: int) -> Int[np.ndarray, " c"]:
    """Indices of `count` points, each as far as possible from those before it, the first being nearest the middle.

    The order of `belief/thinning.py`, on the host and in float64.
    """
    order = np.empty(count, int)
    order[0] = np.argmin(((x - x.mean(axis=0)) ** 2).sum(axis=1))
    squared = np.full(len(x), np.inf)
    for i in range(1, count):
        squared = np.minimum(squared, ((x - x[order[i - 1]]) ** 2).sum(axis=1))
        order[i] = np.argmax(squared)
    return order
