"""Which measurements cannot be: a function of all that were reported, in whatever order they came.

They are judged in the order of time, each by its surprise: how many standard deviations it is from what those before
it lead to expect, under the prior kernel. One beyond the level waits outside until others near it agree. All of it is
float64 on the host.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from maipp.belief.refit import Hyperparameters
from maipp.live.refits import Refits
from maipp.live.sample import Sample
from maipp.live.seen import Old, Seen, correlations

LEVEL = 5.0  # standard deviations; 6 in 10 million of Gaussian values are beyond

# Surprises are measured by their usual size where that is more than 1, as where the kernel promises too much: by the
# median of the latest ones, once there are so many.
_LATEST, _ENOUGH, _NORMAL = 50, 8, 0.6745
# Two measurements agree that are this alike under the kernel, and no farther from each other than so many standard
# deviations. So many others must agree with one for it to be let in.
_ALIKE, _APART, _OTHERS = 0.3, 3.0, 2
# A sensor that gives one value so often is stuck, where the field should have varied by so many steps of it meanwhile.
_STUCK, _STEPS = 5, 10.0


class Verdict(NamedTuple):
    """What is made of a measurement."""

    surprise: float | None  # standard deviations from what was expected, with its sign; None without a gate
    out: str | None  # why it is kept out: "surprise" or "stuck"; None: it counts
    run: int  # how often in a row its robot's sensor gave this value, up to it


class _Step(NamedTuple):
    """Where the judging stood before a measurement, and which of the earlier ones it let in."""

    accepted: int
    waiting: tuple[int, ...]
    kernel: Hyperparameters
    let_in: list[int]


class Gate:
    """Judges measurements, and remembers what it made of those before, so that one more costs little."""

    def __init__(
        self, kernel: Hyperparameters, level: float, old: Old | None = None, refits: Refits | None = None
    ) -> None:
        """`level` is in standard deviations, 0 lets all in; `old` samples are from before; `refits` fit the kernel."""
        self.level, self.guess, self._refits = level, kernel, refits
        self._seen = Seen(kernel, old)
        self._given: list[tuple[Sample, str]] = []
        self._steps: list[_Step] = []
        self._waiting: list[int] = []
        self._scores: list[float] = []
        self._out: list[str | None] = []

    @property
    def kernel(self) -> Hyperparameters:
        """The kernel after the measurements judged last: the guess, until there is a fit."""
        return self._seen.kernel if self._seen.kernel.measurements else self.guess

    @property
    def old(self) -> int:
        """Samples from before the survey."""
        return self._seen.old

    @property
    def fits(self) -> Refits | None:
        """What fits the kernel; None: it stays as it is."""
        return self._refits

    def judge(self, samples: Sequence[Sample], kept: Collection[Sample] = ()) -> list[Verdict]:
        """The verdict on each of the samples, which are in the order of time; those `kept` count whatever they are."""
        runs = _runs(samples)
        if not self.level and self._refits is None:
            return [Verdict(None, None, run) for run in runs]
        start = self.guess if self._refits is None else self._refits.start(samples)
        stuck = self._stuck(samples, runs, start) if self.level else [False] * len(samples)
        given = [
            (sample, "kept" if sample in kept else "stuck" if stuck[i] else "") for i, sample in enumerate(samples)
        ]
        if self._steps and self._steps[0].kernel != start:
            self._rewind(0)
        if not self._given:
            self._seen.turn_to(start)
        same = next((i for i, (a, b) in enumerate(zip(given, self._given, strict=False)) if a != b), None)
        self._rewind(min(len(given), len(self._given)) if same is None else same)
        for each in given[len(self._given) :]:
            self._take(*each)
        scores = self._scores if self.level else [None] * len(given)
        return [Verdict(*each) for each in zip(scores, self._out, runs, strict=True)]

    def _rewind(self, step: int) -> None:
        """Go back to where so many samples had been judged."""
        if step < len(self._given):
            for later in self._steps[step:]:
                for each in later.let_in:
                    self._out[each] = "surprise"
            accepted, waiting, kernel, _ = self._steps[step]
            self._seen.rewind(accepted, kernel)
            self._waiting = [*waiting]
            for parts in (self._given, self._steps, self._scores, self._out):
                del parts[step:]

    def _take(self, sample: Sample, mark: str) -> None:
        """Judge one more."""
        seen = self._seen
        step = _Step(seen.count, tuple(self._waiting), seen.kernel, [])
        index = len(self._given)
        self._given.append((sample, mark))
        self._steps.append(step)
        self._out.append(None)
        expected = seen.expected(sample)
        self._scores.append(expected.score)
        if mark == "stuck":
            self._out[index] = "stuck"
        elif mark == "kept" or not self.level or abs(expected.score) <= self.level * self._usual():
            seen.accept(sample, expected)
        else:
            near = [other for other in self._waiting if self._agree(index, other)]
            # With each other too: spikes that lie around one that is like them are no patch of the field.
            agree = [
                each for each in near if sum(self._agree(each, other) for other in near if other != each) >= _OTHERS - 1
            ]
            if len(agree) >= _OTHERS:
                step.let_in.extend(agree)
                for each in (*agree, index):
                    self._out[each] = None
                    seen.accept(self._given[each][0])
                self._waiting = [other for other in self._waiting if other not in agree]
            else:
                self._out[index] = "surprise"
                self._waiting.append(index)
        if self._refits is not None and self._refits.due(step.accepted - seen.old, seen.count - seen.old):
            seen.turn_to(self._refits.after(seen))

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
        kernel = self.kernel
        shared = float(correlations(kernel, np.array([[a.x, a.y]]), np.array([[b.x, b.y]]))[0, 0])
        apart = float(np.sqrt(2 * (1 - shared) * kernel.std**2 + 2 * kernel.noise))
        return bool(shared >= _ALIKE and abs(a.value - b.value) <= _APART * self._usual() * apart)

    def _stuck(self, samples: Sequence[Sample], runs: Sequence[int], kernel: Hyperparameters) -> list[bool]:
        """Which samples are of a sensor that gives one value again and again; the first of a row may be right."""
        stuck, members = [False] * len(samples), dict[int, list[int]]()
        values = np.unique([sample.value for sample in samples])
        step = float(np.diff(values).min()) if len(values) > 1 else 0.0  # what the sensor rounds to, at most
        for index, (sample, run) in enumerate(zip(samples, runs, strict=True)):
            row = members[sample.robot] = [*(members.get(sample.robot, []) if run > 1 else []), index]
            if run < _STUCK:
                continue
            places = np.array([(samples[i].x, samples[i].y) for i in row])
            varied = kernel.std * np.sqrt(2 * (1 - correlations(kernel, places[:1], places).min()))
            if varied > _STEPS * (step or np.sqrt(kernel.noise)):
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
