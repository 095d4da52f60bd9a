"""The values that a sensor has given lately."""

import math
from collections import deque

_KEPT = 2000


class Sensor:
    """Values with their times, the survey's."""

    def __init__(self, age: float) -> None:
        """A value counts for as many seconds as `age`."""
        self._age = age
        self._values: deque[tuple[float, float]] = deque(maxlen=_KEPT)

    def heard(self, time: float, value: float) -> None:
        """It gave this value, which is none if it is not finite."""
        if math.isfinite(value):
            self._values.append((time, value))

    def at(self, time: float) -> float | None:
        """The value that it had given last at a time, or gave right after; None where both are too old."""
        before = next(
            (value for when, value in reversed(self._values) if when <= time and time - when <= self._age), None
        )
        if before is not None:
            return before
        return next((value for when, value in self._values if time < when <= time + self._age), None)
