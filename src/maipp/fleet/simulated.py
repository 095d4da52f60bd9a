"""A vehicle that is computed: it goes along its way at its speed, drifts, and has a sensor that errs."""

import contextlib
import heapq
import itertools
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maipp.engine.polyline import place_at
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.fleet.clock import Clock
from maipp.fleet.measuring_places import distances_along, length_of
from maipp.fleet.vehicle import Fix, Place, Reached, Reading, Report
from maipp.live.units import Units
from maipp.records import read_json
from maipp.records.kinds import Each, Finite
from maipp.typing import Float

Field = Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, " n"]]

_BAD = (-9999.0, 1e4, 0.0)  # what a sensor says that has lost contact, shown no limit, or fallen dry


@dataclass(frozen=True)
class Errors:
    """What is wrong with a vehicle; standard deviations and speeds in the survey's own units."""

    drift: tuple[float, float] = (0.0, 0.0)  # current that it is carried off by while it holds, lengths per second
    position: float = 0.0  # of a reported position, along each axis
    value: float = 0.0  # of a measured value
    bad: float = 0.0  # chance of a value that cannot be
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.bad <= 1:
            raise InputError(f"bad: {self.bad} is no chance; give a number from 0 to 1")
        for name, value in (("position", self.position), ("noise", self.value)):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name}: {value} is no standard deviation; give a number >= 0")
        if not all(map(math.isfinite, self.drift)):
            raise InputError(f"drift: {self.drift} is no current; give two numbers, lengths per second")


class Simulated:
    """A simulated `Vehicle`; its clock may run faster than the real one.

    What it does follows from the times at which it is told: with a clock that stands still in between, exactly. Its
    errors follow from their seed and the time.
    """

    def __init__(
        self,
        units: Units,
        start: Float[np.ndarray, "2"],
        speed: float,
        interval: float,
        field: Field,
        clock: Clock,
        *,
        errors: Errors | None = None,
        state: Path | None = None,
        moment: float = 0.0,
    ) -> None:
        """At `start` (domain units), with a `speed` (domain units per unit of the scenario's time).

        `field` gives standardised values at domain positions, `interval` is the way between measurements. The file
        `state` is kept up to date with where the vehicle is and goes; one that is there already says where it is now: a
        boat goes on along its way while the computer on it is down. What will happen within a `moment` (the scenario's
        time) counts as having happened.
        """
        self._units, self._speed, self._interval, self._field, self._clock = units, speed, interval, field, clock
        self._errors, self._state, self._moment = errors or Errors(), state, moment
        self._place, self._odometer, self._since = np.asarray(start, np.float64), 0.0, self._now()
        self._leg: Float[np.ndarray, "v 2"] = self._place[None]
        self._due: list[tuple[float, int, float | None]] = []  # time, order, way along the leg; None: its end
        self._number, self._happened = itertools.count(), list[Report]()
        self._measured = 0.0  # odometer at its last measurement
        if state is not None and state.exists():
            self._resume(state)

    def next_time(self) -> float | None:
        """When something will happen, the survey's time; None: it holds."""
        return self._due[0][0] * self._units.seconds_per_time + self._units.epoch if self._due else None

    def where(self) -> Fix:
        """As the protocol has it."""
        now = self._now()
        place, way = self._at(now)
        return self._fix(now, place, self._odometer + way)

    def go(self, waypoints: Sequence[Place], measure: Sequence[Place], *, home: bool = False) -> None:
        """As the protocol has it. Raises `InputError`, and changes nothing, for a place far outside of the domain."""
        way = [self._units.position("waypoints", point) for point in waypoints]
        places = [np.array(self._units.position("measure", point)) for point in measure]
        self._stay()
        self._leg = np.array([self._place, *way])
        now = self._since
        for along in distances_along(self._leg, places, self._interval, self._odometer - self._measured):
            heapq.heappush(self._due, (now + along / self._speed, next(self._number), along))
        heapq.heappush(self._due, (now + self._length / self._speed, next(self._number), None))
        self._save()

    def hold(self) -> None:
        """As the protocol has it; nothing new where it holds already."""
        if len(self._leg) > 1 or self._due:
            self._stay()

    def poll(self) -> list[Report]:
        """As the protocol has it."""
        self._happen(self._now() + self._moment)
        reports, self._happened = self._happened, []
        return reports

    def close(self) -> None:
        """As the protocol has it."""
        self._save()

    @property
    def _length(self) -> float:
        return length_of(self._leg)

    def _now(self) -> float:
        return self._units.time("time", self._clock.now())

    def _happen(self, until: float) -> None:
        """Measure and arrive where that is due."""
        while self._due and self._due[0][0] <= until:
            time, _, along = heapq.heappop(self._due)
            if along is not None:
                self._measured = self._odometer + along
                self._happened.append(self._reading(time, place_at(self._leg, along), self._odometer + along))
                continue
            self._odometer += self._length
            self._place, self._leg, self._since = self._leg[-1], self._leg[-1:], time
            self._happened.append(Reached(**vars(self._fix(time, self._place, self._odometer))))
            self._save()

    def _at(self, now: float) -> tuple[Float[np.ndarray, "2"], float]:
        """Where it is, and its way since it was told to go; one that holds drifts off."""
        gone = max(now - self._since, 0.0)
        if len(self._leg) > 1:
            way = min(gone * self._speed, self._length)
            return place_at(self._leg, way), way
        seconds = gone * self._units.seconds_per_time
        current = np.array(self._errors.drift) * self._units.length("drift", 1.0)
        return self._leg[0] + seconds * current, 0.0

    def _stay(self) -> None:
        """Hold where it is."""
        now = max(self._now(), self._since)
        self._happen(now)
        self._place, way = self._at(now)
        self._odometer, self._leg, self._since, self._due = self._odometer + way, self._place[None], now, []
        self._save()

    def _fix(self, time: float, place: np.ndarray, odometer: float) -> Fix:
        if self._errors.position:
            spread = self._units.length("position", self._errors.position)
            place = place + spread * self._chance(time, 0).standard_normal(2)
        ((x, y),) = self._units.points_out(place[None])
        return Fix(self._units.time_out(time), (x, y), self._units.length_out(odometer))

    def _reading(self, time: float, place: np.ndarray, odometer: float) -> Reading:
        fix = self._fix(time, place, odometer)
        (value,) = self._units.values_out(np.asarray(self._field(place[None]), np.float64))
        chance = self._chance(time, 1)
        value += self._errors.value * float(chance.standard_normal())
        if chance.random() < self._errors.bad:
            value = float(chance.choice(_BAD))
        return Reading(**vars(fix), value=value)

    def _chance(self, time: float, stream: int) -> np.random.Generator:
        """What is random at a time: the same however often it is asked for, and after a restart not what was before."""
        return np.random.default_rng([self._errors.seed, stream, int(np.float64(time).view(np.uint64))])

    def _save(self) -> None:
        if self._state is not None:
            told = {"since": self._since, "odometer": self._odometer, "measured": self._measured}
            told |= {"leg": self._leg.tolist()}
            with contextlib.suppress(InputError):  # the disk is full: it drives on, and its robot's log tells that
                write_atomic(self._state, json.dumps(told) + "\n")

    def _resume(self, path: Path) -> None:
        now = self._since
        try:
            told = read_json(path.read_text("ascii"), strict=True)
            self._since, self._odometer, self._measured = (
                told[key].fit(Finite) for key in ("since", "odometer", "measured")
            )
            self._leg = np.array(told["leg"].fit(Each[tuple[Finite, Finite]]))
        except (OSError, ValueError):  # InputError is one
            raise InputError(f"{path}: not where a simulated vehicle was; remove it, or give another folder") from None
        arrived = self._since + self._length / self._speed
        if len(self._leg) > 1 and now > arrived:  # it has been holding there since
            self._odometer, self._leg, self._since = self._odometer + self._length, self._leg[-1:], arrived
        self._place = self._leg[0]
        self._stay()
