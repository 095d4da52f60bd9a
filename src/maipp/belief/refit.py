"""The kernel of the field being surveyed: what is most likely, given a prior, after the measurements so far.

Maximum a posteriori in float64 on the host. Mean and signal variance are known in closed form for given length scales
and a given ratio of noise to signal variance (`belief/likelihood.py`), so that only these are searched for.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dpotri  # pyright: ignore[reportAttributeAccessIssue]
from scipy.optimize import minimize

from maipp.belief.fit_samples import thinned
from maipp.belief.likelihood import correlation

FEWEST = 6  # measurements before which the guess stands
_MOST = 256  # measurements that are fitted to; more are thinned by place
# Two length scales and a direction replace one length scale where they make the measurements this much more likely
# (natural logarithm); of an isotropic field, twice this gain is beyond the 99th percentile of chi-square of 2.
_GAIN, _ANISOTROPIC = 4.6, 20
# So many of its standard deviations the length scale is taken shorter than the most likely one. With one too long,
# robots pass by what they take for known, and intervals are too narrow.
_CAUTION = 0.5
_STARTS = (0.35, 1.0, 2.8)  # of the expected length scale, tried where nothing was found before
_ANGLES = (0.0, 0.25 * math.pi, 0.5 * math.pi, 0.75 * math.pi)
_ASPECT = 0.5  # standard deviation of half the logarithm of the ratio of both length scales
_RATIO = (1e-6, 1e2)  # noise variance over the signal's
# Standard deviation of the mean in those of the field: where the prior knows it, and where it is around the median.
_LEVEL, _AROUND_MEDIAN = 0.3, 2.0


class HyperPrior(NamedTuple):
    """What is thought of a kernel beforehand: medians, and how far from them the truth may be."""

    length_scale: float  # domain units
    noise: float  # variance of a measurement
    std: float = 1.0  # of the field, around a mean of 0
    scale_spread: float = 0.7  # standard deviation of the length scale's logarithm
    noise_spread: float = 0.5  # and of the noise's
    weight: float = 5.0  # half the number of values that the guess of the deviation is worth
    level_known: bool = True  # False: nothing is known of the mean
    shortest: float = 0.02  # domain units
    longest: float = 3.0

    @property
    def guess(self) -> "Hyperparameters":
        """The kernel before there are measurements."""
        return Hyperparameters(0.0, self.std, self.length_scale, self.noise)


class Hyperparameters(NamedTuple):
    """A Matern 3/2 kernel with constant mean and noise."""

    mean: float  # of the field
    std: float
    length_scale: float  # domain units; of two, their geometric mean
    noise: float  # variance of a measurement
    aspect: float = 1.0  # the longer length scale over the shorter one
    direction: float = 0.0  # of the longer one, radians anticlockwise from x
    measurements: int = 0  # that it was fitted to, or thinned from; 0: a guess

    @property
    def warp(self) -> Float[np.ndarray, "2 2"]:
        """The symmetric matrix of determinant 1 that takes offsets to where the field has one length scale."""
        return _warp(0.5 * math.log(self.aspect), self.direction)


def refit(
    x: Float[np.ndarray, "n 2"],
    y: Float[np.ndarray, " n"],
    prior: HyperPrior,
    noise_factors: Float[np.ndarray, " n"] | None = None,
    before: Hyperparameters | None = None,
) -> Hyperparameters:
    """The most likely kernel after measurements `y` at `x` (domain units).

    `noise_factors` multiply the noise variance of each; `before` is what was found of fewer of them, from where the
    search goes on. Fewer than six measurements leave the guess. Source: Rasmussen & Williams 2006, Sec. 5.4.1; the
    closed forms e.g. in Gelman et al. 2013, Sec. 3.3.
    """
    if len(y) < FEWEST:
        return prior.guess
    keep = thinned(x, _MOST)
    data = _Data(x[keep], y[keep], np.ones(len(keep)) if noise_factors is None else noise_factors[keep], prior)
    ratio = math.log(prior.noise / prior.std**2)
    starts = [np.array([math.log(prior.length_scale * factor), ratio]) for factor in _STARTS]
    if before is not None and before.measurements:
        found = np.array([math.log(before.length_scale), math.log(before.noise / before.std**2)])
        starts = [found] if len(keep) > 60 else [found, starts[1]]
    best = min((_search(data, start) for start in starts), key=lambda result: result.fun)
    if len(keep) >= _ANISOTROPIC:
        turned = [np.array([*best.x, 0.3, angle]) for angle in _ANGLES]
        turned = min(turned, key=lambda start: data(start)[0])
        if before is not None and before.aspect > 1:
            turned = np.array([*found, 0.5 * math.log(before.aspect), before.direction])
        two = _search(data, turned)
        if best.fun - two.fun > _GAIN:
            best = two
    return data.fitted(_cautious(data, best.x), len(y))


def _cautious(data: "_Data", found: np.ndarray) -> np.ndarray:
    """The parameters with a length scale that is shorter by a part of its uncertainty, the others following along."""
    step = 1e-4
    slopes = [data(found + side)[1] - data(found - side)[1] for side in step * np.eye(len(found))]
    curvature = np.array(slopes) / (2 * step)
    try:
        covariance = np.linalg.inv(0.5 * (curvature + curvature.T))
    except np.linalg.LinAlgError:
        return found
    if not covariance[0, 0] > 0:  # on a bound
        return found
    spread = min(math.sqrt(covariance[0, 0]), data.prior.scale_spread)
    return found - _CAUTION * spread * covariance[0] / covariance[0, 0]


class _Data:
    """The negative log posterior of the search's parameters, with its gradient.

    They are the logarithms of the length scale and of noise over signal variance and, where there are four, half the
    logarithm of the ratio of both length scales and the direction of the longer one.
    """

    def __init__(self, x: np.ndarray, y: np.ndarray, factors: np.ndarray, prior: HyperPrior) -> None:
        self.offsets = x[:, None] - x[None]
        self.squared = (self.offsets**2).sum(axis=-1)[None]
        self.centre = 0.0 if prior.level_known else float(np.median(y))
        self.y, self.factors, self.prior = y - self.centre, factors, prior
        self.mean_variance = (_LEVEL if prior.level_known else _AROUND_MEDIAN) ** 2
        self.weight = prior.weight
        self.ratio = math.log(prior.noise / prior.std**2)

    def solved(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        """Lower factor of the covariance over the signal variance, its inverse times y, `decay`, squares, variance."""
        squared = self.squared
        if len(parameters) > 2:
            squared = ((self.offsets @ _warp(*parameters[2:])) ** 2).sum(axis=-1)[None]
        matrix, decay, _ = correlation(squared, np.exp(parameters[:1]))
        matrix += self.mean_variance
        matrix[np.diag_indices(len(matrix))] += math.exp(parameters[1]) * self.factors
        factor = cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)
        white = solve_triangular(factor, self.y, lower=True, check_finite=False)
        alpha = solve_triangular(factor, white, lower=True, trans=1, check_finite=False)
        squares = self.weight * self.prior.std**2 + 0.5 * float(white @ white)
        variance = squares / (self.weight + 0.5 * len(self.y))
        return factor, alpha, decay, squared[0], variance

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        prior, half = self.prior, self.weight + 0.5 * len(self.y)
        factor, alpha, decay, squared, variance = self.solved(parameters)
        value = float(np.log(np.diag(factor)).sum()) + half * math.log(variance)
        inverse = np.tril(dpotri(factor, lower=1, overwrite_c=1)[0])
        inverse = inverse + np.tril(inverse, -1).T
        slope = 0.5 * (inverse - np.outer(alpha, alpha) / variance)  # of the value in the matrix
        stretch = slope * decay * (3.0 / math.exp(2 * parameters[0]))
        gradient = np.empty(len(parameters))
        gradient[0] = np.vdot(stretch, squared)
        gradient[1] = math.exp(parameters[1]) * float(np.diag(slope) @ self.factors)
        pulls = [
            (parameters[0] - math.log(prior.length_scale), prior.scale_spread),
            (parameters[1] - self.ratio, prior.noise_spread),
        ]
        if len(parameters) > 2:
            along, across = _axes(parameters[3])
            a, b = (self.offsets @ along), (self.offsets @ across)
            shrink = math.exp(-2 * parameters[2])
            gradient[2] = np.vdot(stretch, shrink * a**2 - b**2 / shrink)
            gradient[3] = -np.vdot(stretch, (shrink - 1 / shrink) * a * b)
            pulls.append((parameters[2], _ASPECT))
        for index, (offset, spread) in enumerate(pulls):
            value += 0.5 * (offset / spread) ** 2
            gradient[index] += offset / spread**2
        return value, gradient

    def fitted(self, parameters: np.ndarray, count: int) -> Hyperparameters:
        """The kernel at these parameters."""
        _, alpha, _, _, variance = self.solved(parameters)
        half, direction = (float(p) for p in parameters[2:]) if len(parameters) > 2 else (0.0, 0.0)
        if half < 0:
            half, direction = -half, direction + 0.5 * math.pi
        return Hyperparameters(
            mean=self.centre + self.mean_variance * float(alpha.sum()),
            std=math.sqrt(variance),
            length_scale=math.exp(parameters[0]),
            noise=math.exp(parameters[1]) * variance,
            aspect=math.exp(2 * half),
            direction=direction % math.pi,
            measurements=count,
        )


def _search(data: _Data, start: np.ndarray):  # noqa: ANN202 (of SciPy)
    prior = data.prior
    bounds = [(math.log(prior.shortest), math.log(prior.longest)), tuple(map(math.log, _RATIO))]
    bounds += [(-1.2, 1.2), (None, None)] if len(start) > 2 else []
    return minimize(data, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 40, "ftol": 1e-6})


def _axes(direction: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along and across a direction."""
    c, s = math.cos(direction), math.sin(direction)
    return np.array([c, s]), np.array([-s, c])


def _warp(half: float, direction: float) -> np.ndarray:
    along, across = _axes(direction)
    return np.outer(along, along) * math.exp(-half) + np.outer(across, across) * math.exp(half)
