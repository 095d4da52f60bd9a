"""The measurements that count, as the next one is judged by them: a Cholesky factor that grows by a row at a time."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from maipp.belief.likelihood import correlation
from maipp.belief.refit import Hyperparameters
from maipp.live.sample import Sample
from maipp.typing import Float

_LARGEST = 1e6  # values and surprises beyond are cut to this, so that squares stay finite
_LEAST = 1e-9  # of the signal variance: what is left at least, for a factor that exists


class Old(NamedTuple):
    """Samples from before the survey."""

    x: Float[np.ndarray, "p 2"]  # domain units
    y: Float[np.ndarray, " p"]  # standardised
    noise: Float[np.ndarray, " p"]  # variance of each, in units of that of a measurement


class Expected(NamedTuple):
    """What those before a measurement lead to expect of it."""

    row: Float[np.ndarray, " k"]  # whitened covariances with them
    deviation: float  # of the measurement
    score: float  # standard deviations that it is from the expected value


def correlations(
    kernel: Hyperparameters, a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, "m 2"]
) -> Float[np.ndarray, "n m"]:
    """Correlations of the field between places."""
    offsets = a[:, None] - b[None]
    offsets = offsets if kernel.aspect == 1 else offsets @ kernel.warp
    return correlation((offsets**2).sum(axis=-1)[None], np.array([kernel.length_scale]))[0]


class Seen:
    """Measurements taken in, in their order, under a kernel."""

    def __init__(self, kernel: Hyperparameters, old: Old | None) -> None:
        self.old = 0 if old is None else len(old.y)
        self.count = self.old
        room = max(2 * self.old, 64)
        self.x, self.y, self.factors = np.zeros((room, 2)), np.zeros(room), np.ones(room)
        self._rows, self._white = np.zeros((room, room)), np.zeros(room)
        if old is not None:
            self.x[: self.old], self.y[: self.old], self.factors[: self.old] = old
        self.kernel = kernel
        self._factor()

    def turn_to(self, kernel: Hyperparameters) -> None:
        """Go on under another kernel."""
        if kernel != self.kernel:
            self.kernel = kernel
            self._factor()

    def rewind(self, count: int, kernel: Hyperparameters) -> None:
        """Forget all but the first so many."""
        self.count = count
        self.turn_to(kernel)

    def expected(self, sample: Sample) -> Expected:
        """What is expected of a measurement."""
        at, count, variance = np.array([[sample.x, sample.y]]), self.count, self.kernel.std**2
        known = variance * correlations(self.kernel, self.x[:count], at)[:, 0]
        row = solve_triangular(self._rows[:count, :count], known, lower=True, check_finite=False) if count else known
        left = max(variance - float(row @ row), _LEAST * variance)
        deviation = float(np.sqrt(left + self.kernel.noise))
        rest = _cut(sample.value) - self.kernel.mean - float(row @ self._white[:count])
        return Expected(row, deviation, float(_cut(rest / deviation)))

    def accept(self, sample: Sample, expected: Expected | None = None) -> None:
        """Take in a measurement."""
        row, deviation, score = expected or self.expected(sample)
        count = self.count
        if count == len(self.x):
            self.x = np.concatenate([self.x, np.zeros_like(self.x)])
            self.y, self.factors = (np.concatenate([a, np.ones_like(a)]) for a in (self.y, self.factors))
            self._white = np.concatenate([self._white, np.zeros_like(self._white)])
            self._rows = np.pad(self._rows, ((0, count), (0, count)))
        self.x[count], self.y[count], self.factors[count] = (sample.x, sample.y), _cut(sample.value), 1.0
        self._rows[count, :count], self._rows[count, count], self._white[count] = row, deviation, score
        self.count += 1

    def _factor(self) -> None:
        """Factor anew all that is there."""
        count, variance = self.count, self.kernel.std**2
        covariance = variance * correlations(self.kernel, self.x[:count], self.x[:count])
        noise = np.maximum(self.kernel.noise * self.factors[:count], _LEAST * variance)
        self._rows[:count, :count] = cholesky(covariance + np.diag(noise), lower=True) if count else covariance
        rest = self.y[:count] - self.kernel.mean
        self._white[:count] = solve_triangular(self._rows[:count, :count], rest, lower=True) if count else rest


def _cut(value: float) -> float:
    return float(np.clip(value, -_LARGEST, _LARGEST))
