"""Sensors that give one value again and again, where the field should have varied meanwhile."""

from typing import Any

import numpy as np

from maipp.belief.refit import Hyperparameters
from maipp.live.incremental_posterior import correlations
from maipp.live.scaled_measurement import ScaledMeasurement

# A sensor that gives one value so often is stuck, where the field should have varied by so many steps of it meanwhile.
_STUCK, _STEPS = 5, 10.0


class RepeatedValues:
    """Measurements of one value that robots gave in a row; it remembers those before, so that one more costs little."""

    def __init__(self) -> None:
        self.runs: list[int] = []  # how often in a row each one's robot gave its value, up to it
        self._samples: list[ScaledMeasurement] = []
        self._rows: dict[int, list[list[int]]] = {}  # of each robot, one after another: which measurements they are
        self._long: dict[int, list[int]] = {}  # those that may be of a stuck sensor, by their first measurement

    def turn_to(self, samples: list[ScaledMeasurement]) -> None:
        """Be of these samples, which are in the order of time."""
        same = alike(samples, self._samples)
        while len(self._samples) > same:
            self._forget()
        for index in range(same, len(samples)):
            self._add(index, samples[index])

    def stuck(self, kernel: Hyperparameters) -> list[int]:
        """Which samples are of a stuck sensor; the first of a row may be right."""
        if not self._long:
            return []
        values = np.unique([sample.value for sample in self._samples])
        step = float(np.diff(values).min()) if len(values) > 1 else 0.0  # what the sensor rounds to, at most
        stuck: list[int] = []
        for row in self._long.values():
            places = np.array([(self._samples[i].x, self._samples[i].y) for i in row])
            varied = kernel.std * np.sqrt(2 * (1 - correlations(kernel, places[:1], places).min()))
            if varied > _STEPS * (step or np.sqrt(kernel.noise)):
                stuck += row[1:]
        return stuck

    def _add(self, index: int, sample: ScaledMeasurement) -> None:
        rows = self._rows.setdefault(sample.robot, [])
        if rows and self._samples[rows[-1][-1]].value == sample.value:
            rows[-1].append(index)
        else:
            rows.append([index])
        row = rows[-1]
        self._samples.append(sample)
        self.runs.append(len(row))
        if len(row) == _STUCK:
            self._long[row[0]] = row

    def _forget(self) -> None:
        """Be without the last one."""
        rows = self._rows[self._samples.pop().robot]
        self.runs.pop()
        if len(rows[-1]) == _STUCK:
            del self._long[rows[-1][0]]
        rows[-1].pop()
        if not rows[-1]:
            rows.pop()


def alike(one: list[Any], other: list[Any]) -> int:
    """How many members two lists have in common at their beginning."""
    low, high = 0, min(len(one), len(other))
    if one[:high] == other[:high]:
        return high
    while high - low > 1:  # the first `low` are the same, the first `high` are not
        middle = (low + high) // 2
        if one[low:middle] == other[low:middle]:
            low = middle
        else:
            high = middle
    return low
