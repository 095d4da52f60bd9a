"""The vehicle of an autopilot: each way is a mission of its own, uploaded while it holds."""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from maipp.fleet.clock import Clock
from maipp.fleet.mavlink.autopilot import Autopilot
from maipp.fleet.mavlink.course import UNDER_WAY, AutopilotSettings, Course, Notices
from maipp.fleet.mavlink.inside import Inside
from maipp.fleet.mavlink.link import StampedMessage
from maipp.fleet.mavlink.passing import Passed, Passing
from maipp.fleet.mavlink.sensor import Sensor
from maipp.fleet.vehicle import Fix, Place, Reached, Reading, Report
from maipp.typing import Float

_LOST, _NO_POSITION = 5.0, 3.0  # s without a heartbeat, without a position
_STAYED = 5.0  # s at its last waypoint after which it counts as there, though its message has not come
_STILL, _MOVES = 20.0, 2.0  # s in which it should have moved so many metres, if it is under way
_FAR = 5  # radii from a waypoint at which a message that it is reached is of an earlier mission
_MOVED = 0.01  # metres
_LAST_WORDS = 1.0  # s that the autopilot has to hold at the end


class LocalPlane(NamedTuple):
    """Where it drives: metres of a plane, and the survey's own coordinates."""

    to_plane: Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, "n 2"]]
    to_user: Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, "n 2"]]  # longitudes and latitudes
    inside: Inside
    interval: float  # metres between measurements
    radius: float = 5.0  # metres from a waypoint at which it is there


class Senses(NamedTuple):
    """Where measurements come from."""

    sensor: Sensor
    name: str  # of the NAMED_VALUE_FLOAT with its values
    take: Callable[[], None] = lambda: None  # gives it values that come otherwise; called at each poll


@runtime_checkable
class Channel(Protocol):
    """The way to the autopilot (`MavlinkConnection`)."""

    def send(self, name: str, *fields: Any) -> None:
        """Send a message."""
        ...

    def take(self) -> list[StampedMessage]:
        """What has come."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Drive:
    """A `Vehicle` with an autopilot."""

    def __init__(
        self,
        channel: Channel,
        autopilot: Autopilot,
        ground: LocalPlane,
        choice: AutopilotSettings,
        senses: Senses,
        clock: Clock,
        told: Notices,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._channel, self._autopilot, self._ground, self._senses = channel, autopilot, ground, senses
        self._clock, self._told, self._monotonic = clock, told, monotonic
        self.course = Course(autopilot, choice, told)
        self._passing: Passing | None = None
        self._waypoints: Float[np.ndarray, "n 2"] = np.zeros((0, 2))  # metres
        self._there = math.inf  # since when it has been at the last of them, monotonic
        self._home: Place | None = None  # where its way home ends
        self._at_home: Place | None = None  # the same, once it is there
        self._still = (np.full(2, math.nan), math.inf)  # a place, and since when it has been near it, monotonic
        self._asked = -math.inf
        self._reports: list[Report] = []
        self._closed = False

    @property
    def known(self) -> bool:
        """Whether the autopilot was heard, and where it is."""
        return self._autopilot.kind is not None and math.isfinite(self._autopilot.longitude)

    def where(self) -> Fix:
        """As the protocol has it; at the end of its way home, which no autopilot hits to the metre, it is at home."""
        self._work()
        fix = self._fix(self._clock.now(), self._position())
        return fix if self._at_home is None else Fix(fix.time, self._at_home)

    def go(self, waypoints: Sequence[Place], measure: Sequence[Place], *, home: bool = False) -> None:
        """As the protocol has it. The way home is a mission too: a return to launch knows no no-go zones."""
        self._work()
        ground = self._ground
        planned, places = (ground.to_plane(np.array(each, np.float64).reshape(-1, 2)) for each in (waypoints, measure))
        self._waypoints, moved = ground.inside.moved(planned)
        for number in np.flatnonzero(moved > _MOVED):
            self._told.say(f"waypoint {number + 1} is moved by {moved[number]:.1f} m, into the fence")
        since = 0.0 if self._passing is None else self._passing.since
        way = np.concatenate([self._position()[None], self._waypoints])
        self._still, self._at_home = (np.full(2, math.nan), math.inf), None
        self._home = (waypoints[-1][0], waypoints[-1][1]) if home else None
        self._passing, self._there = Passing(way, list(places), ground.interval, since), math.inf
        self.course.go(ground.to_user(self._waypoints), self._monotonic())

    def hold(self) -> None:
        """As the protocol has it."""
        self.course.rest(self._monotonic())
        self._work()

    def poll(self) -> list[Report]:
        """As the protocol has it."""
        self._work()
        reports, self._reports = self._reports, []
        return reports

    def close(self) -> None:
        """As the protocol has it."""
        if self._closed:
            return
        self._closed = True
        self.hold()
        end = time.monotonic() + _LAST_WORDS
        while self._autopilot.custom == self.course.modes.mission.custom and time.monotonic() < end:
            time.sleep(0.02)
            self._work()
        self._channel.close()

    def _work(self) -> None:
        """Take up what has come, and do what is due."""
        self._senses.take()
        for heard in self._channel.take():
            if self._autopilot.hear(heard):
                self._hear(heard)
        now = self._monotonic()
        if now - self._autopilot.beat > _LOST:
            if self._autopilot.kind is not None:
                self._told.since("lost", f"autopilot not heard for {_LOST:.0f} s")
            return
        self._told.over("lost", "autopilot heard again")
        if now - self._autopilot.position_now > _NO_POSITION:
            if now - self._asked > _NO_POSITION:
                self._asked = now
                self._autopilot.ask_for_positions()
            if self.known and now - self._autopilot.beat < _NO_POSITION:
                self._told.since("position", "the autopilot does not say where it is")
        else:
            self._told.over("position", "the autopilot says again where it is")
        self.course.tick(now)
        if self.course.state == UNDER_WAY:
            self._look_whether_there(now)
            self._look_whether_it_moves(now)

    def _hear(self, heard: StampedMessage) -> None:
        kind, message = heard.message.get_type(), heard.message
        if kind == "NAMED_VALUE_FLOAT":
            if message.name.rstrip("\0") == self._senses.name:
                self._senses.sensor.heard(heard.time, message.value)
        elif kind == "GLOBAL_POSITION_INT":
            if self._passing is not None and self.course.moves:
                self._measure(self._passing.move(self._position(), heard.time))
        elif (number := self.course.hear(heard)) is not None:
            # What comes from far away is of an earlier mission.
            if np.hypot(*(self._waypoints[number] - self._position())) <= _FAR * self._ground.radius:
                self._at_waypoint(number, heard.time)

    def _at_waypoint(self, number: int, now: float) -> None:
        assert self._passing is not None
        position = self._position()
        self.course.reached(number)
        self._measure(self._passing.at_vertex(number + 1, position, now))
        if number == len(self._waypoints) - 1:
            fix = self._fix(now, position)
            self._at_home = self._home
            self._reports.append(Reached(fix.time, self._at_home or fix.position))
            self.course.rest(self._monotonic())

    def _look_whether_there(self, now: float) -> None:
        """It has stayed at its last waypoint: what says so got lost."""
        passing, radius = self._passing, self._ground.radius
        if passing is None or passing.progress < passing.length - 2 * radius:
            return
        if np.hypot(*(self._waypoints[-1] - self._position())) > radius:
            self._there = math.inf
        else:
            self._there = min(self._there, now)
            if now - self._there > _STAYED:
                self._at_waypoint(len(self._waypoints) - 1, self._clock.now())

    def _look_whether_it_moves(self, now: float) -> None:
        """It stands still: something that it was told got lost, or something holds it."""
        place, since = self._still
        position = self._position()
        if not np.hypot(*(position - place)) <= _MOVES or self._autopilot.custom != self.course.modes.mission.custom:
            self._still = position, now
            self._told.over("still", "moves again")
        elif now - since > _STILL and self._passing is not None:
            self._told.since("still", f"has not moved for {_STILL:.0f} s: told again where to go")
            self._still = position, now
            self.course.again(min(self._passing.vertex, len(self._waypoints) - 1), now)

    def _measure(self, passed: list[Passed]) -> None:
        for place in passed:
            value = self._senses.sensor.at(place.time)
            if value is None:
                self._told.since("sensor", "no value of the sensor: nothing is measured where it should be")
            else:
                self._told.over("sensor", "values of the sensor again")
                fix = self._fix(place.time, place.position)
                self._reports.append(Reading(fix.time, fix.position, None, value))

    def _position(self) -> Float[np.ndarray, "2"]:
        return self._ground.to_plane(np.array([[self._autopilot.longitude, self._autopilot.latitude]]))[0]

    def _fix(self, now: float, position: Float[np.ndarray, "2"]) -> Fix:
        ((x, y),) = self._ground.to_user(position[None]).tolist()
        return Fix(now, (round(x, 9), round(y, 9)))
