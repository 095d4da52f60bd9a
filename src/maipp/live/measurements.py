"""What has been measured: a set, whose order is always the same whichever order its members came in."""

from bisect import insort
from typing import NamedTuple

import numpy as np

from maipp.typing import Bool, Float


class Sample(NamedTuple):
    """A measurement in the order that measurements are conditioned in: by time, then robot, then what it says."""

    time: float  # the scenario's time
    robot: int
    x: float  # domain units
    y: float
    value: float  # standardised


class Slots(NamedTuple):
    """Measurements as a belief takes them: prior samples first, then the others in order, then empty slots."""

    x: Float[np.ndarray, "n 2"]
    y: Float[np.ndarray, " n"]
    mask: Bool[np.ndarray, " n"]


def slots_for(count: int, room: int) -> int:
    """Slots that hold `count` measurements: the smallest power of two that is at least `room` and `count`.

    Each power is a shape of its own to compile for, so that there are few of them.
    """
    return 1 << max(count - 1, room - 1, 1).bit_length()


class Measurements:
    """The measurements so far and the prior samples.

    The same measurement reported under two ids counts once. `slots` depends on the set alone, not on its history.
    """

    def __init__(
        self, prior_x: Float[np.ndarray, "p 2"], prior_y: Float[np.ndarray, " p"], room: int, real: np.dtype
    ) -> None:
        self._prior_x, self._prior_y, self._room, self._real = prior_x, prior_y, room, real
        self._ordered: list[Sample] = []
        self._seen: set[Sample] = set()
        self._slots: Slots | None = None

    def __len__(self) -> int:
        return len(self._ordered)

    def add(self, sample: Sample) -> None:
        """Take in a measurement."""
        if sample not in self._seen:
            self._seen.add(sample)
            insort(self._ordered, sample)
            self._slots = None

    @property
    def capacity(self) -> int:
        """Slots in use and empty."""
        return slots_for(len(self._ordered) + len(self._prior_y), self._room)

    def slots(self) -> Slots:
        """All measurements, as many slots as `capacity` says."""
        if self._slots is None:
            rows = np.array([(s.x, s.y, s.value) for s in self._ordered], np.float64).reshape(-1, 3)
            count, filled = self.capacity, len(rows) + len(self._prior_y)
            x, y = np.zeros((count, 2), self._real), np.zeros(count, self._real)
            x[:filled] = np.concatenate([self._prior_x, rows[:, :2]])
            y[:filled] = np.concatenate([self._prior_y, rows[:, 2]])
            self._slots = Slots(x, y, np.arange(count) < filled)
        return self._slots
