"""Which measurements cannot be: a function of all that were reported, in whatever order they came.

They are judged in the order of time, each by its surprise: how many standard deviations it is from what those before
it lead to expect, under the prior kernel. One beyond the level waits outside until others near it agree. All of it is
float64 on the host.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from maipp.belief.likelihood import correlation
from maipp.live.sample import Sample
from maipp.typing import Float

LEVEL = 5.0  # standard deviations; 6 in 10 million of Gaussian values are beyond

# Surprises are measured by their usual size where that is more than 1, as where the kernel promises too much: by the
# median of the latest ones, once there are so many.
_LATEST, _ENOUGH, _NORMAL = 50, 8, 0.6745
# Two measurements agree that are this alike under the kernel, and no farther from each other than so many standard
# deviations. So many others must agree with one for it to be let in.
_ALIKE, _APART, _OTHERS = 0.3, 3.0, 2
# A sensor that gives one value so often is stuck, where the field should have varied by so many steps of it meanwhile.
_STUCK, _STEPS = 5, 10.0
_LARGEST = 1e6  # standardised values beyond are cut to this, so that squares stay finite


class Kernel(NamedTuple):
    """The prior: Matern 3/2 with mean 0."""

    length_scale: float  # domain units
    variance: float
    noise: float  # variance of a measurement

    def __call__(self, a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "n m"]:
        """Covariances."""
        squared = ((a[:, None] - b[None]) ** 2).sum(axis=-1)[None]
        return self.variance * correlation(squared, np.array([self.length_scale]))[0]


class Verdict(NamedTuple):
    """What is made of a measurement."""

    surprise: float | None  # standard deviations from what was expected, with its sign; None without a gate
    out: str | None  # why it is kept out: "surprise" or "stuck"; None: it counts
    run: int  # how often in a row its robot's sensor gave this value, up to it


class _Step(NamedTuple):
    """Where the judging stood before a measurement, and which of the earlier ones it let in."""

    accepted: int
    waiting: tuple[int, ...]
    let_in: list[int]


class Gate:
    """Judges measurements, and remembers what it made of those before, so that one more costs little."""

    def __init__(
        self,
        kernel: Kernel,
        level: float,
        prior: tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"], Float[np.ndarray, " p"]] | None = None,
    ) -> None:
        """`level` in standard deviations, 0 lets everything in; `prior` are places, values and noise variances."""
        self.kernel, self.level = kernel, level
        count = 0 if prior is None else len(prior[1])
        self._x, self._rows = np.zeros((max(2 * count, 64), 2)), np.zeros((max(2 * count, 64),) * 2)
        self._white = np.zeros(len(self._x))
        self._count = count  # that later ones are judged by
        if prior is not None and count:
            covariance = kernel(prior[0], prior[0]) + np.diag(np.maximum(prior[2], 1e-9 * kernel.variance))
            self._x[:count], self._rows[:count, :count] = prior[0], cholesky(covariance, lower=True)
            self._white[:count] = solve_triangular(self._rows[:count, :count], prior[1], lower=True)
        self._given: list[tuple[Sample, str]] = []
        self._steps: list[_Step] = []
        self._waiting: list[int] = []
        self._scores: list[float] = []
        self._out: list[str | None] = []

    def judge(self, samples: Sequence[Sample], kept: Collection[Sample] = ()) -> list[Verdict]:
        """The verdict on each of the samples, which are in the order of time; those `kept` count whatever they are."""
        runs = _runs(samples)
        if not self.level:
            return [Verdict(None, None, run) for run in runs]
        stuck = self._stuck(samples, runs)
        given = [
            (sample, "kept" if sample in kept else "stuck" if stuck[i] else "") for i, sample in enumerate(samples)
        ]
        same = next((i for i, (a, b) in enumerate(zip(given, self._given, strict=False)) if a != b), None)
        self._rewind(min(len(given), len(self._given)) if same is None else same)
        for each in given[len(self._given) :]:
            self._take(*each)
        return [Verdict(*each) for each in zip(self._scores, self._out, runs, strict=True)]

    def _rewind(self, step: int) -> None:
        """Go back to where so many samples had been judged."""
        if step < len(self._given):
            for later in self._steps[step:]:
                for each in later.let_in:
                    self._out[each] = "surprise"
            self._count, waiting, _ = self._steps[step]
            self._waiting = [*waiting]
            for parts in (self._given, self._steps, self._scores, self._out):
                del parts[step:]

    def _take(self, sample: Sample, mark: str) -> None:
        """Judge one more."""
        step = _Step(self._count, tuple(self._waiting), [])
        index = len(self._given)
        self._given.append((sample, mark))
        self._steps.append(step)
        self._out.append(None)
        row, deviation = self._expected(sample)
        expected = float(row @ self._white[: self._count])
        score = (float(np.clip(sample.value, -_LARGEST, _LARGEST)) - expected) / deviation
        score = float(np.clip(score, -_LARGEST, _LARGEST))
        self._scores.append(score)
        if mark == "stuck":
            self._out[index] = "stuck"
        elif mark == "kept" or abs(score) <= self.level * self._usual():
            self._accept(sample, row, deviation, score)
        else:
            agree = [other for other in self._waiting if self._agree(index, other)]
            if len(agree) >= _OTHERS:
                step.let_in.extend(agree)
                for each in (*agree, index):
                    self._out[each] = None
                    self._accept(self._given[each][0])
                self._waiting = [other for other in self._waiting if other not in agree]
            else:
                self._out[index] = "surprise"
                self._waiting.append(index)

    def _expected(self, sample: Sample) -> tuple[Float[np.ndarray, " k"], float]:
        """The whitened covariances with what is accepted, and the standard deviation of a measurement there."""
        at, count = np.array([[sample.x, sample.y]]), self._count
        known = self.kernel(self._x[:count], at)[:, 0]
        row = solve_triangular(self._rows[:count, :count], known, lower=True, check_finite=False) if count else known
        left = self.kernel.variance - float(row @ row)
        return row, float(np.sqrt(max(left, 1e-9 * self.kernel.variance) + self.kernel.noise))

    def _accept(
        self, sample: Sample, row: np.ndarray | None = None, deviation: float = 0.0, score: float = 0.0
    ) -> None:
        """Condition what follows on a measurement."""
        if row is None:
            row, deviation = self._expected(sample)
            expected = float(row @ self._white[: self._count])
            score = (float(np.clip(sample.value, -_LARGEST, _LARGEST)) - expected) / deviation
        count = self._count
        if count == len(self._x):
            self._x = np.concatenate([self._x, np.zeros_like(self._x)])
            self._white = np.concatenate([self._white, np.zeros_like(self._white)])
            self._rows = np.pad(self._rows, ((0, count), (0, count)))
        self._x[count] = sample.x, sample.y
        self._rows[count, :count], self._rows[count, count], self._white[count] = row, deviation, score
        self._count += 1

    def _usual(self) -> float:
        """How large surprises usually are, at least 1."""
        latest = np.abs(self._scores[-_LATEST:])
        return 1.0 if len(latest) < _ENOUGH else max(1.0, float(np.median(latest)) / _NORMAL)

    def _agree(self, index: int, other: int) -> bool:
        """Whether two measurements beyond the level say the same of one place."""
        a, b = self._given[index][0], self._given[other][0]
        if a.stray or b.stray or (a.robot == b.robot and a.value == b.value):
            return False
        if self._scores[index] * self._scores[other] <= 0:
            return False
        shared = float(self.kernel(np.array([[a.x, a.y]]), np.array([[b.x, b.y]]))[0, 0]) / self.kernel.variance
        apart = float(np.sqrt(2 * (1 - shared) * self.kernel.variance + 2 * self.kernel.noise))
        return bool(shared >= _ALIKE and abs(a.value - b.value) <= _APART * self._usual() * apart)

    def _stuck(self, samples: Sequence[Sample], runs: Sequence[int]) -> list[bool]:
        """Which samples are of a sensor that gives one value again and again; the first of a row may be right."""
        stuck, members = [False] * len(samples), dict[int, list[int]]()
        values = np.unique([sample.value for sample in samples])
        step = float(np.diff(values).min()) if len(values) > 1 else 0.0  # what the sensor rounds to, at most
        for index, (sample, run) in enumerate(zip(samples, runs, strict=True)):
            row = members[sample.robot] = [*(members.get(sample.robot, []) if run > 1 else []), index]
            if run < _STUCK:
                continue
            places = np.array([(samples[i].x, samples[i].y) for i in row])
            varied = np.sqrt(2 * (self.kernel.variance - self.kernel(places[:1], places).min()))
            if varied > _STEPS * (step or np.sqrt(self.kernel.noise)):
                for i in row[1:]:
                    stuck[i] = True
        return stuck


def _runs(samples: Sequence[Sample]) -> list[int]:
    """How often in a row each sample's robot measured this value, up to it."""
    last: dict[int, tuple[float, int]] = {}
    runs = []
    for sample in samples:
        value, run = last.get(sample.robot, (None, 0))
        last[sample.robot] = sample.value, run + 1 if value == sample.value else 1
        runs.append(last[sample.robot][1])
    return runs
