"""The time of a survey, as each robot's computer has it."""

import time
from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Seconds since the survey's epoch, plus the epoch: times as the robot reports them."""

    def now(self) -> float:
        """The time."""
        ...


class WallClock:
    """The computer's own time, in which `speedup` seconds of the survey pass in one second since the `epoch`."""

    def __init__(self, epoch: float, speedup: float = 1.0, begun: float | None = None) -> None:
        """`begun` is the Unix time at which the survey's time is the epoch; left out: with a speed-up, now."""
        self._epoch, self._speedup = epoch, speedup
        self._begun = (epoch if speedup == 1.0 else time.time()) if begun is None else begun

    def now(self) -> float:
        """The time."""
        return self._epoch + max(time.time() - self._begun, 0.0) * self._speedup


class VirtualClock:
    """A time that stands still until it is moved."""

    def __init__(self, time: float = 0.0) -> None:
        self.time = time

    def now(self) -> float:
        """The time."""
        return self.time
