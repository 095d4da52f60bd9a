"""Which measurements cannot be: a function of all that were reported, in whatever order they came.

They are judged in the order of time, each by its surprise: how many standard deviations it is from what those before
it lead to expect, under the prior kernel. One beyond the level waits outside until others near it agree. All of it is
float64 on the host.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from maipp.belief.refit import Hyperparameters
from maipp.live.incremental_posterior import ConditionedSamples, IncrementalPosterior, correlations
from maipp.live.refits import Refits
from maipp.live.repeated_values import RepeatedValues, alike
from maipp.live.scaled_measurement import ScaledMeasurement

LEVEL = 5.0  # standard deviations; 6 in 10 million of Gaussian values are beyond

# Surprises are measured by their usual size where that is more than 1, as where the kernel promises too much: by the
# median of the latest ones, once there are so many.
_LATEST, _ENOUGH, _NORMAL = 50, 8, 0.6745
# Two measurements agree that are this alike under the kernel, and no farther from each other than so many standard
# deviations. So many others must agree with one for it to be let in.
_ALIKE, _APART, _OTHERS = 0.3, 3.0, 2


class Verdict(NamedTuple):
    """What is made of a measurement."""

    surprise: float | None  # standard deviations from what was expected, with its sign; None without a gate
    out: str | None  # why it is kept out: "surprise" or "stuck"; None: it counts
    run: int  # how often in a row its robot's sensor gave this value, up to it


class _GateState(NamedTuple):
    """Where the judging stood before a measurement, and which of the earlier ones it let in."""

    accepted: int
    waiting: tuple[int, ...]
    kernel: Hyperparameters
    let_in: list[int]


class Gate:
    """Judges measurements, and remembers what it made of those before, so that one more costs little."""

    def __init__(
        self, kernel: Hyperparameters, level: float, old: ConditionedSamples | None = None, refits: Refits | None = None
    ) -> None:
        """`level` is in standard deviations, 0 lets all in; `old` samples are from before; `refits` fit the kernel."""
        self.level, self.guess, self._refits = level, kernel, refits
        self._seen = IncrementalPosterior(kernel, old)
        self._rows = RepeatedValues()
        # Of each sample judged: what it is marked as, where the judging stood, its surprise, what was made of it.
        self._samples: list[ScaledMeasurement] = []
        self._marks: list[str] = []  # "kept", "stuck" or nothing
        self._steps: list[_GateState] = []
        self._scores: list[float] = []
        self._verdicts: list[Verdict] = []
        self._waiting: list[int] = []
        self._out: set[int] = set()

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

    def judge(self, samples: Sequence[ScaledMeasurement], kept: Collection[ScaledMeasurement] = ()) -> list[Verdict]:
        """The verdict on each of the samples, which are in the order of time; those `kept` count whatever they are."""
        samples = [*samples]
        self._rows.turn_to(samples)
        start = self.guess if self._refits is None else self._refits.start(samples)
        marks = [""] * len(samples)
        for index in self._rows.stuck(start) if self.level else ():
            marks[index] = "stuck"
        for sample in kept:
            marks[samples.index(sample)] = "kept"
        if self._steps and self._steps[0].kernel != start:
            self._rewind(0)
        if not self._samples:
            self._seen.switch_kernel(start)
        self._rewind(min(alike(samples, self._samples), alike(marks, self._marks)))
        for index in range(len(self._samples), len(samples)):
            self._take(samples[index], marks[index])
        return [*self._verdicts]

    @property
    def out(self) -> list[int]:
        """Which of the samples judged last do not count, in no order."""
        return [*self._out]

    def _rewind(self, step: int) -> None:
        """Go back to where so many samples had been judged."""
        if step < len(self._samples):
            for later in self._steps[step:]:
                for each in later.let_in:
                    self._decide(each, "surprise")
            for each in [each for each in self._out if each >= step]:
                self._out.discard(each)
            accepted, waiting, kernel, _ = self._steps[step]
            self._seen.rewind(accepted, kernel)
            self._waiting = [*waiting]
            for parts in (self._samples, self._marks, self._steps, self._scores, self._verdicts):
                del parts[step:]

    def _decide(self, index: int, out: str | None) -> None:
        """Whether one counts."""
        self._verdicts[index] = self._verdicts[index]._replace(out=out)
        (self._out.add if out else self._out.discard)(index)

    def _take(self, sample: ScaledMeasurement, mark: str) -> None:
        """Judge one more."""
        seen = self._seen
        step = _GateState(seen.count, tuple(self._waiting), seen.kernel, [])
        index = len(self._samples)
        self._samples.append(sample)
        self._marks.append(mark)
        self._steps.append(step)
        run = self._rows.runs[index]
        if not self.level and self._refits is None:
            self._scores.append(0.0)
            self._verdicts.append(Verdict(None, None, run))
            return
        expected = seen.expected(sample)
        self._scores.append(expected.score)
        self._verdicts.append(Verdict(expected.score if self.level else None, None, run))
        if mark == "stuck":
            self._decide(index, "stuck")
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
                    self._decide(each, None)
                    seen.accept(self._samples[each])
                self._waiting = [other for other in self._waiting if other not in agree]
            else:
                self._decide(index, "surprise")
                self._waiting.append(index)
        if self._refits is not None and self._refits.due(step.accepted - seen.old, seen.count - seen.old):
            seen.switch_kernel(self._refits.after(seen))

    def _usual(self) -> float:
        """How large surprises usually are, at least 1."""
        latest = np.abs(self._scores[-_LATEST:])
        return 1.0 if len(latest) < _ENOUGH else max(1.0, float(np.median(latest)) / _NORMAL)

    def _agree(self, index: int, other: int) -> bool:
        """Whether two measurements beyond the level say the same of one place."""
        a, b = self._samples[index], self._samples[other]
        if a.stray or b.stray or (a.robot == b.robot and a.value == b.value):
            return False
        if self._scores[index] * self._scores[other] <= 0:
            return False
        kernel = self.kernel
        shared = float(correlations(kernel, np.array([[a.x, a.y]]), np.array([[b.x, b.y]]))[0, 0])
        apart = float(np.sqrt(2 * (1 - shared) * kernel.std**2 + 2 * kernel.noise))
        return bool(shared >= _ALIKE and abs(a.value - b.value) <= _APART * self._usual() * apart)
