"""When a vehicle passes the places at which it is to measure, by the positions that it reports on its way."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from maipp.fleet.measuring_places import distances_along
from maipp.typing import Float

_SLACK = 5.0  # metres that its way may be longer than it moved, as where it cuts a corner
_ROUNDING = 1e-6  # metres
_ALIKE = 0.5  # metres: of two legs that are so alike near to it, it is on the first


class Passed(NamedTuple):
    """A place that it passed."""

    time: float
    position: Float[np.ndarray, "2"]  # where it was then, metres


class Passing:
    """The progress along one way; lengths and places in metres of a plane."""

    def __init__(
        self, way: Float[np.ndarray, "v 2"], places: Sequence[Float[np.ndarray, "2"]], interval: float, since: float
    ) -> None:
        """Along `way`, from where it is; the last measurement was `since` before, the next are an `interval` apart."""
        self._way = way
        self._marks = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        self._due = distances_along(way, places, interval, since)
        self.progress = 0.0
        self._last: Passed | None = None
        self._measured = -since

    @property
    def length(self) -> float:
        """Of the whole way."""
        return float(self._marks[-1])

    @property
    def vertex(self) -> int:
        """Of the way's vertices the last that it has passed."""
        return int(np.searchsorted(self._marks, self.progress + _ROUNDING, side="right")) - 1

    @property
    def since(self) -> float:
        """Way since the last place that it passed."""
        return self.progress - self._measured

    def move(self, position: Float[np.ndarray, "2"], time: float) -> list[Passed]:
        """It is at `position`: what it has passed since it was last heard of, interpolated between the two."""
        here = Passed(time, position)
        if self._last is None:
            self._last = Passed(time, self._way[0])
        moved = float(np.hypot(*(position - self._last.position)))
        most = min(self.progress + 2 * moved + _SLACK, self.length)
        return self._until(max(self.progress, self._nearest(position, most)), here)

    def at_vertex(self, number: int, position: Float[np.ndarray, "2"], time: float) -> list[Passed]:
        """It has reached that vertex of the way, the start being 0."""
        return self._until(max(self.progress, float(self._marks[number])), Passed(time, position))

    def _nearest(self, position: Float[np.ndarray, "2"], most: float) -> float:
        """The way to the point nearest to a position, from where it was and no farther than `most`."""
        between = self._marks[(self._marks > self.progress) & (self._marks < most)]
        marks = np.concatenate([[self.progress], between, [most]])
        part = np.stack([np.interp(marks, self._marks, self._way[:, axis]) for axis in (0, 1)], axis=-1)
        steps, lengths = np.diff(part, axis=0), np.diff(marks)
        shares = ((position - part[:-1]) * steps).sum(axis=1) / np.maximum(lengths**2, 1e-12)
        shares = np.clip(shares, 0.0, 1.0)
        gaps = np.hypot(*(part[:-1] + shares[:, None] * steps - position).T)
        first = int(np.argmax(gaps <= gaps.min() + _ALIKE))
        return float(marks[first] + shares[first] * lengths[first])

    def _until(self, progress: float, here: Passed) -> list[Passed]:
        before, begin, passed = self._last or here, self.progress, []
        while self._due and self._due[0] <= progress + _ROUNDING:
            along = self._due.pop(0)
            share = min(max((along - begin) / (progress - begin), 0.0), 1.0) if progress > begin else 1.0
            time = before.time + share * (here.time - before.time)
            passed.append(Passed(time, before.position + share * (here.position - before.position)))
            self._measured = along
        self.progress, self._last = progress, here
        return passed
