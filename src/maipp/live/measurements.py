"""What has been measured: a set, whose order is always the same whichever order its members came in."""

from bisect import insort
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from maipp.belief.refit import Hyperparameters
from maipp.live.gate import Gate, Verdict
from maipp.live.refits import Refits
from maipp.live.scaled_measurement import LARGEST_VALUE, ScaledMeasurement
from maipp.typing import Bool, Float, Int


class Slots(NamedTuple):
    """Measurements as the engine takes them: the slots of one robot after those of another, empty ones last."""

    x: Float[np.ndarray, "s 2"]
    y: Float[np.ndarray, " s"]
    time: Float[np.ndarray, " s"]  # inf in empty slots
    by: Int[np.ndarray, " s"]  # the robot that each slot is for
    mask: Bool[np.ndarray, " s"]


class Override(NamedTuple):
    """What a person decided on a measurement, and when; of several the latest counts."""

    time: float
    event: str  # id of the event that said so
    kept: bool  # it counts whatever it is; else it is withdrawn


class Verdicts(NamedTuple):
    """What is made of the measurements that are not withdrawn."""

    samples: list[ScaledMeasurement]  # in the order of time
    verdicts: list[Verdict]
    out: set[ScaledMeasurement]  # those that do not count, and those that are withdrawn

    def of(self, sample: ScaledMeasurement) -> Verdict | None:
        """The verdict on one of them; None: it is withdrawn."""
        return self.verdicts[self.samples.index(sample)] if sample in self.samples else None

    @property
    def counted(self) -> list[ScaledMeasurement]:
        """Those that count, in the order of time."""
        return [sample for sample, verdict in zip(self.samples, self.verdicts, strict=True) if verdict.out is None]


class MeasurementSet:
    """The measurements so far, and which of them count.

    The same measurement reported under two ids counts once. All depends on the set of reports, not on their order.
    """

    def __init__(self, robots: int, room: int, real: np.dtype, gate: Gate) -> None:
        """Room for `room` measurements of each robot at first; it doubles when one of them needs more."""
        self._robots, self._room, self._real, self._gate = robots, room, real, gate
        self._ordered: list[ScaledMeasurement] = []
        self._seen: set[ScaledMeasurement] = set()
        self._ids: dict[str, ScaledMeasurement] = {}  # of every report
        self._decisions: dict[str, Override] = {}  # by the id of the report
        self._slots: Slots | None = None

    def __len__(self) -> int:
        """How many count."""
        return len(self._ordered) - len(self.verdicts().out)

    def add(self, sample: ScaledMeasurement, report: str) -> None:
        """Take in a measurement; `report` is the id of the event that told it."""
        if sample not in self._seen:
            insort(self._ordered, sample)
        self._seen.add(sample)
        self._ids[report] = sample
        self._slots = None

    def admit(self, robots: int, room: int) -> None:
        """Make room for so many robots, and so many measurements of each at first."""
        if (robots, room) != (self._robots, self._room):
            self._robots, self._room, self._slots = robots, room, None

    def decide(self, report: str, decision: Override) -> None:
        """Take in what a person decided on the measurement told by a report, which may still come."""
        self._decisions[report] = max(decision, self._decisions.get(report, decision))
        self._slots = None

    def knows(self, report: str) -> bool:
        """Whether the report has come."""
        return report in self._ids

    def has(self, sample: ScaledMeasurement) -> bool:
        """Whether the measurement has come, under whatever report."""
        return sample in self._seen

    def verdicts(
        self, more: tuple[ScaledMeasurement, str] | None = None, decided: Mapping[str, Override] | None = None
    ) -> Verdicts:
        """What is made of the measurements.

        As if one `more`, with the id of its report, had come, and the decisions `decided` had been made.
        """
        given, extra = [*self._ordered], {} if more is None else {more[1]: more[0]}
        if more is not None and more[0] not in self._seen:
            insort(given, more[0])
        decisions = dict(self._decisions)
        for report, decision in (decided or {}).items():
            decisions[report] = max(decision, decisions.get(report, decision))
        latest: dict[ScaledMeasurement, Override] = {}
        for report, decision in decisions.items():
            sample = extra.get(report) or self._ids.get(report)
            if sample is not None:
                latest[sample] = max(decision, latest.get(sample, decision))
        withdrawn = {sample for sample, decision in latest.items() if not decision.kept}
        for sample in withdrawn:
            given.remove(sample)
        verdicts = self._gate.judge(given, latest.keys() - withdrawn)
        return Verdicts(given, verdicts, withdrawn.union(given[index] for index in self._gate.out))

    def reports(self, samples: Collection[ScaledMeasurement]) -> list[str]:
        """The ids of the reports that told these measurements, in order."""
        return sorted(report for report, sample in self._ids.items() if sample in samples) if samples else []

    @property
    def everything(self) -> list[tuple[str, ScaledMeasurement, str | None]]:
        """Every measurement in the order of time: its first report, and why it does not count (None: it counts)."""
        verdicts, first = self.verdicts(), dict[ScaledMeasurement, str]()
        for report, sample in sorted(self._ids.items(), reverse=True):
            first[sample] = report
        out = {sample: verdict.out for sample, verdict in zip(*verdicts[:2], strict=True)}
        return [(first[sample], sample, out.get(sample, "withdrawn")) for sample in self._ordered]

    @property
    def kernel(self) -> Hyperparameters | None:
        """The kernel that the measurements that count have been found to have; None: the one of the mission stands."""
        self.verdicts()
        return None if self._gate.fits is None else self._gate.kernel

    @property
    def standard(self) -> tuple[float, float]:
        """What values of the slots are less, and what they are then divided by."""
        kernel = self.kernel
        return (0.0, 1.0) if kernel is None else (kernel.mean, kernel.std / self._gate.guess.std)

    @property
    def guess(self) -> Hyperparameters:
        """The mission's kernel."""
        return self._gate.guess

    @property
    def old(self) -> int:
        """Samples from before the survey."""
        return self._gate.old

    @property
    def fits(self) -> Refits | None:
        """What fits the kernel; None: it stays as it is."""
        return self._gate.fits

    def slots(self) -> Slots:
        """The measurements that count; those of each robot have as many slots, in use and empty.

        Values are standardised by the kernel that was found, if any. Each number of slots is a shape of its own to
        compile for, so that there are few of them.
        """
        if self._slots is None:
            mean, scale = self.standard
            own: list[list[ScaledMeasurement]] = [[] for _ in range(self._robots)]
            for sample in self.verdicts().counted:
                own[sample.robot].append(sample)
            each = room_for(max(map(len, own)), self._room)
            x, y = np.zeros((self._robots, each, 2), self._real), np.zeros((self._robots, each), self._real)
            time = np.full((self._robots, each), np.inf, self._real)
            for robot, samples in enumerate(own):
                rows = np.array([(s.x, s.y, s.value, s.time) for s in samples], np.float64).reshape(-1, 4)
                x[robot, : len(rows)] = rows[:, :2]
                y[robot, : len(rows)] = np.clip((rows[:, 2] - mean) / scale, -LARGEST_VALUE, LARGEST_VALUE)
                time[robot, : len(rows)] = rows[:, 3]
            by = np.repeat(np.arange(self._robots, dtype=np.int32), each)
            flat = time.reshape(-1)
            self._slots = Slots(x.reshape(-1, 2), y.reshape(-1), flat, by, np.isfinite(flat))
        return self._slots


def room_for(most: int, room: int) -> int:
    """Slots of each robot for so many measurements of the busiest: `room`, doubled until they fit."""
    return room << (max(-(-most // room), 1) - 1).bit_length()
