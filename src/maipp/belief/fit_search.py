"""Search for the length scales and the noise ratio that make samples most likely, in units of the samples' spread."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from maipp.belief.fit_samples import thinned
from maipp.belief.likelihood import Likelihood, best_ratio, profile_likelihood, squared_differences

# Noise variance over signal variance. Below, float64 could no longer tell it from none; above, the values are noise.
RATIO_BOUNDS = (1e-6, 1e3)

# Length scales tried for starts, the likeliest peaks among which the search begins from.
_SCALES, _RATIOS, _STARTS = 12, 28, 3

# The starts are sought on this many samples at most, and the search among them is done on this many at most: with
# more, only the best is followed to the end, since a likelihood of 2,000 samples takes a second.
_START_SAMPLES, _SEARCH_SAMPLES = 300, 400

# A parameter this close to a bound, on the log scale, sits on it.
_AT_BOUND = 1e-3


class Optimum(NamedTuple):
    """The likeliest parameters."""

    parameters: Float[np.ndarray, " p"]  # log length scales, then log noise ratio
    likelihood: Likelihood
    low: tuple[bool, ...]  # for each parameter, whether it sits on its lower bound
    high: tuple[bool, ...]  # on its upper one


def bounds(x: Float[np.ndarray, "n 2"]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Log bounds of a length scale, and of the noise ratio.

    A length scale is at least half the usual distance of neighbours, below which samples tell nothing of each other,
    and at most five times the longest side of the samples' box, above which they are a plane to each other.
    """
    places = np.unique(x, axis=0)
    nearest = np.median(cKDTree(places).query(places, k=2)[0][:, 1])
    longest = np.ptp(x, axis=0).max()
    low, high = np.log(RATIO_BOUNDS)
    return (float(np.log(0.5 * nearest)), float(np.log(5.0 * longest))), (float(low), float(high))


def search(x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], mean: float | None = None) -> Optimum:
    """The likeliest kernel with one length scale."""
    limits = bounds(x)
    few = thinned(x, _SEARCH_SAMPLES)
    found = best_of(x[few], y[few], starts(x, y, mean), limits, mean)
    return found if len(few) == len(x) else best_of(x, y, [found.parameters], limits, mean)


def search_per_axis(
    x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], isotropic: Optimum, mean: float | None = None
) -> Optimum:
    """The likeliest kernel with a length scale along each axis, sought from the best with one (of the same samples)."""
    scale, ratio = isotropic.parameters
    begun = [np.array([scale + turn, scale - turn, ratio]) for turn in (0.0, 0.7, -0.7)]
    scales, ratios = bounds(x)
    # Along the axis that matters little the scale may be far longer than for both together.
    return best_of(x, y, begun, ((scales[0], scales[1] + np.log(4.0)), ratios), mean)


def starts(x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], mean: float | None) -> list[Float[np.ndarray, "2"]]:
    """The likeliest peaks over the length scale, the noise ratio being the best of several at each."""
    (shortest, longest), (low, high) = bounds(x)
    few = thinned(x, _START_SAMPLES)
    scales = np.linspace(shortest, longest, _SCALES)
    values, ratios = profile(x[few], y[few], scales, np.linspace(low, high, _RATIOS), mean)
    around = np.concatenate([[-np.inf], values, [-np.inf]])
    peaks = np.flatnonzero((values >= around[:-2]) & (values >= around[2:]))
    best = peaks[np.argsort(-values[peaks])][:_STARTS]
    return [np.array([scales[i], ratios[i]]) for i in best]


def profile(
    x: Float[np.ndarray, "n 2"],
    y: Float[np.ndarray, " n"],
    log_scales: Float[np.ndarray, " s"],
    log_ratios: Float[np.ndarray, " g"],
    mean: float | None = None,
) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, " s"]]:
    """For each log length scale the highest log marginal likelihood over the rest, and the log ratio that has it."""
    squared = squared_differences(x, per_axis=False)
    rows = [best_ratio(float(scale), squared, y, log_ratios, mean) for scale in log_scales]
    values, ratios = np.array(rows).T
    return values, ratios


def best_of(
    x: Float[np.ndarray, "n 2"],
    y: Float[np.ndarray, " n"],
    begun: Sequence[Float[np.ndarray, " p"]],
    limits: tuple[tuple[float, float], tuple[float, float]],
    mean: float | None,
) -> Optimum:
    """The best end of a quasi-Newton search from each start."""
    axes = len(begun[0]) - 1
    squared = squared_differences(x, per_axis=axes > 1)
    box = [limits[0]] * axes + [limits[1]]

    def loss(parameters: Float[np.ndarray, " p"]) -> tuple[float, Float[np.ndarray, " p"]]:
        likelihood = profile_likelihood(parameters, squared, y, mean)
        return -likelihood.value, -likelihood.gradient

    ends = []
    for start in begun:
        inside = np.clip(start, [low for low, _ in box], [high for _, high in box])
        result = minimize(loss, inside, jac=True, bounds=box, method="L-BFGS-B", options={"ftol": 1e-11, "gtol": 1e-4})
        ends.append((result.fun, result.x))
    parameters = min(ends, key=lambda end: end[0])[1]
    return Optimum(
        parameters,
        profile_likelihood(parameters, squared, y, mean),
        tuple(bool(p - low < _AT_BOUND) for p, (low, _) in zip(parameters, box, strict=True)),
        tuple(bool(high - p < _AT_BOUND) for p, (_, high) in zip(parameters, box, strict=True)),
    )
