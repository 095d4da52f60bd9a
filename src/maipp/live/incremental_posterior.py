"""The measurements that count, as the next one is judged by them: a Cholesky factor that grows by a row at a time.

Of very many only those near by tell anything of the next one, and only they are asked.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from maipp.belief.likelihood import correlation
from maipp.belief.refit import Hyperparameters
from maipp.live.scaled_measurement import ScaledMeasurement
from maipp.typing import Float

_LARGEST = 1e6  # values and surprises beyond are cut to this, so that squares stay finite
_MOST, _NEAREST = 512, 96  # beyond so many, so many of the nearest are asked
_LEAST = 1e-9  # of the signal variance: what is left at least, for a factor that exists


class ConditionedSamples(NamedTuple):
    """Samples from before the survey."""

    x: Float[np.ndarray, "p 2"]  # domain units
    y: Float[np.ndarray, " p"]  # standardised
    noise: Float[np.ndarray, " p"]  # variance of each, in units of that of a measurement


class Prediction(NamedTuple):
    """What those before a measurement lead to expect of it."""

    row: Float[np.ndarray, " k"]  # whitened covariances with them, or with the nearest
    deviation: float  # of the measurement
    score: float  # standard deviations that it is from the expected value


def correlations(
    kernel: Hyperparameters, a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, "m 2"]
) -> Float[np.ndarray, "n m"]:
    """Correlations of the field between places."""
    offsets = a[:, None] - b[None]
    offsets = offsets if kernel.aspect == 1 else offsets @ kernel.warp
    return correlation((offsets**2).sum(axis=-1)[None], np.array([kernel.length_scale]))[0]


class IncrementalPosterior:
    """Measurements taken in, in their order, under a kernel."""

    def __init__(self, kernel: Hyperparameters, old: ConditionedSamples | None) -> None:
        self.old = 0 if old is None else len(old.y)
        self.count = self.old
        room = max(2 * self.old, 64)
        self.x, self.y, self.factors = np.zeros((room, 2)), np.zeros(room), np.ones(room)
        if old is not None:
            self.x[: self.old], self.y[: self.old], self.factors[: self.old] = old
        self._rows, self._white = np.zeros((0, 0)), np.zeros(0)
        self._factored: tuple[int, Hyperparameters | None] = 0, None  # how many have rows, and under which kernel
        self.kernel = kernel

    def switch_kernel(self, kernel: Hyperparameters) -> None:
        """Go on under another kernel."""
        self.kernel = kernel

    def rewind(self, count: int, kernel: Hyperparameters) -> None:
        """Forget all but the first so many."""
        self.count, self.kernel = count, kernel
        self._factored = min(self._factored[0], count), self._factored[1]

    def expected(self, sample: ScaledMeasurement) -> Prediction:
        """What is expected of a measurement."""
        count, place = self.count, np.array([[sample.x, sample.y]])
        if count <= _MOST:
            self._factor()
            x, rows, white = self.x[:count], self._rows[:count, :count], self._white[:count]
        else:
            x, rows, white = self._near(place)
        known = self.kernel.std**2 * correlations(self.kernel, x, place)[:, 0]
        row = solve_triangular(rows, known, lower=True, check_finite=False) if len(x) else known
        left = max(self.kernel.std**2 - float(row @ row), _LEAST * self.kernel.std**2)
        deviation = float(np.sqrt(left + self.kernel.noise))
        rest = _cut(sample.value) - self.kernel.mean - float(row @ white)
        return Prediction(row, deviation, float(_cut(rest / deviation)))

    def accept(self, sample: ScaledMeasurement, expected: Prediction | None = None) -> None:
        """Take in a measurement."""
        row, deviation, score = expected or self.expected(sample)
        count = self.count
        if count == len(self.x):
            self.x = np.concatenate([self.x, np.zeros_like(self.x)])
            self.y, self.factors = (np.concatenate([a, np.ones_like(a)]) for a in (self.y, self.factors))
        self.x[count], self.y[count], self.factors[count] = (sample.x, sample.y), _cut(sample.value), 1.0
        if count < _MOST and self._factored == (count, self.kernel):
            self._make_room(count + 1)
            self._rows[count, :count], self._rows[count, count], self._white[count] = row, deviation, score
            self._factored = count + 1, self.kernel
        self.count += 1

    def _make_room(self, count: int) -> None:
        if count > len(self._white):
            more = max(count, min(2 * count, _MOST), 64) - len(self._white)
            self._rows, self._white = np.pad(self._rows, ((0, more), (0, more))), np.pad(self._white, (0, more))

    def _factor(self) -> None:
        """Factor all that is there, unless that is done."""
        count = self.count
        if self._factored == (count, self.kernel):
            return
        self._make_room(count)
        self._rows[:count, :count], self._white[:count] = self._factor_of(np.arange(count))
        self._factored = count, self.kernel

    def _near(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The nearest measurements: where, the factor of their covariance, their whitened values."""
        offsets = self.x[: self.count] - place
        offsets = offsets if self.kernel.aspect == 1 else offsets @ self.kernel.warp
        squared = (offsets**2).sum(axis=1)
        chosen = np.flatnonzero(squared <= np.partition(squared, _NEAREST)[_NEAREST])
        return self.x[chosen], *self._factor_of(chosen)

    def _factor_of(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, variance = self.x[chosen], self.kernel.std**2
        covariance = variance * correlations(self.kernel, x, x)
        if not len(chosen):
            return covariance, np.zeros(0)
        noise = np.maximum(self.kernel.noise * self.factors[chosen], _LEAST * variance)
        rows = cholesky(covariance + np.diag(noise), lower=True, check_finite=False)
        white = solve_triangular(rows, self.y[chosen] - self.kernel.mean, lower=True, check_finite=False)
        return rows, white


def _cut(value: float) -> float:
    return float(np.clip(value, -_LARGEST, _LARGEST))
