"""What has been measured: a set, whose order is always the same whichever order its members came in."""

from bisect import insort
from typing import NamedTuple

import numpy as np

from maipp.typing import Bool, Float, Int


class Sample(NamedTuple):
    """A measurement in the order that measurements of a robot are conditioned in: by time, then what it says."""

    time: float  # the scenario's time
    robot: int
    x: float  # domain units
    y: float
    value: float  # standardised


class Slots(NamedTuple):
    """Measurements as the engine takes them: the slots of one robot after those of another, empty ones last."""

    x: Float[np.ndarray, "s 2"]
    y: Float[np.ndarray, " s"]
    time: Float[np.ndarray, " s"]  # inf in empty slots
    by: Int[np.ndarray, " s"]  # the robot that each slot is for
    mask: Bool[np.ndarray, " s"]


class Measurements:
    """The measurements so far.

    The same measurement reported under two ids counts once. `slots` depends on the set alone, not on its history.
    """

    def __init__(self, robots: int, room: int, real: np.dtype) -> None:
        """Room for `room` measurements of each robot at first; it doubles when one of them needs more."""
        self._room, self._real = room, real
        self._ordered: list[list[Sample]] = [[] for _ in range(robots)]
        self._seen: set[Sample] = set()
        self._slots: Slots | None = None

    def __len__(self) -> int:
        return len(self._seen)

    def add(self, sample: Sample) -> None:
        """Take in a measurement."""
        if sample not in self._seen:
            self._seen.add(sample)
            insort(self._ordered[sample.robot], sample)
            self._slots = None

    @property
    def slots_per_robot(self) -> int:
        """Slots in use and empty. Each number is a shape of its own to compile for, so that there are few of them."""
        most = max(map(len, self._ordered))
        return self._room << (max(-(-most // self._room), 1) - 1).bit_length()

    def slots(self) -> Slots:
        """All measurements."""
        if self._slots is None:
            robots, each = len(self._ordered), self.slots_per_robot
            x, y = np.zeros((robots, each, 2), self._real), np.zeros((robots, each), self._real)
            time = np.full((robots, each), np.inf, self._real)
            for robot, samples in enumerate(self._ordered):
                rows = np.array([(s.x, s.y, s.value, s.time) for s in samples], np.float64).reshape(-1, 4)
                x[robot, : len(rows)], y[robot, : len(rows)] = rows[:, :2], rows[:, 2]
                time[robot, : len(rows)] = rows[:, 3]
            by = np.repeat(np.arange(robots, dtype=np.int32), each)
            flat = time.reshape(-1)
            self._slots = Slots(x.reshape(-1, 2), y.reshape(-1), flat, by, np.isfinite(flat))
        return self._slots
