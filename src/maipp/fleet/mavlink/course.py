"""The way to be gone as an autopilot's mission, from holding to being under way, whatever gets lost."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from maipp.fleet.mavlink.autopilot import Autopilot
from maipp.fleet.mavlink.link import StampedMessage
from maipp.fleet.mavlink.mission_items import items_of
from maipp.fleet.mavlink.modes import PX4, Modes, modes_of
from maipp.fleet.mavlink.upload import FENCE, Upload
from maipp.route_files.qgc_plan import MissionItem
from maipp.route_files.vehicle_settings import AUTOPILOTS, VehicleSettings
from maipp.typing import Float

_REPEAT, _PAUSE = 1.5, 10.0  # s from a command to the next, and from a mission that was refused to the next attempt
_SURE = 3.0  # s after which a mode is what somebody chose, not an old message

# It stays; it is to stop before it gets another mission; it gets its fence, once, and that; it is told where in it to
# begin; it is to go; it goes.
REST, STOPPING, FENCING, UPLOADING, CHOOSING, STARTING, UNDER_WAY = range(7)


class Notices:
    """What is said to people: what is so for a while once, and that it is over."""

    def __init__(self, robot: str, tell: Callable[[str], None]) -> None:
        self._robot, self._tell, self._lasting = robot, tell, set[str]()

    def say(self, text: str) -> None:
        """Say it."""
        self._tell(f"{self._robot}: {text}")

    def since(self, what: str, text: str) -> None:
        """Say once that something is so, from now on."""
        if what not in self._lasting:
            self._lasting.add(what)
            self.say(text)

    def over(self, what: str, text: str = "") -> None:
        """Say that it is no more, if it was."""
        if what in self._lasting:
            self._lasting.discard(what)
            if text:
                self.say(text)


class AutopilotSettings(NamedTuple):
    """What was chosen for a vehicle."""

    vehicle: VehicleSettings
    speed: Callable[[], float]  # metres per second, as it is now
    hold: str = ""  # mode in which it holds; empty: the usual one
    fence: Sequence[MissionItem] = ()  # what its fence is to be; none: the one that it has


class Course:
    """One way after the other. It changes the mode from holding to the mission and back, and no other mode.

    A person arms the vehicle, and puts it into the mode in which it holds; one who takes it over has it.
    """

    def __init__(self, autopilot: Autopilot, choice: AutopilotSettings, told: Notices) -> None:
        self._autopilot, self._choice, self._told = autopilot, choice, told
        self.state = REST
        self._upload: Upload | None = None
        self._fence = choice.fence  # that it has not got yet
        self._waypoints: Float[np.ndarray, "n 2"] = np.zeros((0, 2))
        self._first = 0  # number of the mission's item that is the first waypoint
        self._next = 0  # the waypoint that is the next one
        self._sent, self._entered = -math.inf, -math.inf

    @property
    def modes(self) -> Modes:
        """The two modes that are used."""
        return modes_of(self._autopilot.family(self._told_kind), self._choice.vehicle.kind, self._choice.hold)

    @property
    def moves(self) -> bool:
        """Whether it may be on its way."""
        return self.state in (STARTING, UNDER_WAY)

    def go(self, waypoints: Float[np.ndarray, "n 2"], now: float) -> None:
        """Go along these, longitudes and latitudes."""
        self._waypoints, self._upload, self._next = waypoints, None, 0
        self._told.over("taken")
        self._enter(STOPPING, now)

    def again(self, number: int, now: float) -> None:
        """Go on to a waypoint from where it stands still, having missed what it was told."""
        self._next = number
        self._enter(STOPPING, now)

    def rest(self, now: float) -> None:
        """Stop where it is, or stay where it arrived; nothing new where it does already."""
        if self.state == REST:
            return
        self._upload = None
        self._enter(REST, now)

    def hear(self, heard: StampedMessage) -> int | None:
        """Take up a message; the number of a waypoint (from 0) that it says to have reached."""
        message = heard.message
        if message.get_type() == "MISSION_ITEM_REACHED":
            number = message.seq - self._first
            return number if self.moves and 0 <= number < len(self._waypoints) else None
        if self._upload is not None:
            self._upload.hear(message, heard.now)
            if self._upload.resumed:
                self._upload.resumed = False
                if self.state in (CHOOSING, STARTING, UNDER_WAY) and not self._next:
                    self._enter(CHOOSING, heard.now)  # only now it has all of the mission
        return None

    def reached(self, number: int) -> None:
        """It was at a waypoint of this way."""
        self._next = max(self._next, number + 1)

    def tick(self, now: float) -> None:
        """Do what is due."""
        autopilot, modes = self._autopilot, self.modes
        in_mission = autopilot.custom == modes.mission.custom
        if self.state in (REST, STOPPING):
            if in_mission:
                self._repeat(now, lambda: autopilot.set_mode(modes.hold))
            elif self.state == STOPPING and self._may_start(modes):
                if self._upload is not None and self._upload.done:
                    self._enter(CHOOSING, now)
                else:
                    self._begin(now)
        elif self.state in (FENCING, UPLOADING) and self._upload is not None:
            self._continue(self._upload, now)
        elif self.state == CHOOSING:
            number = self._first + self._next
            begin = number if self._next else number - 1  # the speed comes before the first waypoint
            current = autopilot.current
            if current is not None and self._asked_before(current[1]) and begin <= current[0] <= number:
                self._enter(STARTING, now)
            else:
                self._repeat(now, lambda: autopilot.send("mission_set_current", begin))
        elif self.state == STARTING:
            if in_mission and self._asked_before(autopilot.beat):
                self._told.over("mode")
                self._enter(UNDER_WAY, now)
            elif self._may_start(modes):
                if autopilot.refused is not None:
                    self._told.since("mode", f"the autopilot refuses {modes.mission.name}: {autopilot.refused}")
                self._repeat(now, lambda: autopilot.set_mode(modes.mission))
        elif in_mission:
            self._told.over("taken", f"back in {modes.mission.name}")
        elif now - self._entered < _SURE and autopilot.custom == modes.hold.custom:
            self._enter(STARTING, now)  # what it said was from before
        elif autopilot.beat > self._entered + _SURE:
            self._told.since("taken", f"another mode was chosen: it goes on once it is back in {modes.mission.name}")

    @property
    def _told_kind(self) -> int:
        return AUTOPILOTS[self._choice.vehicle.autopilot]

    def _continue(self, upload: Upload, now: float) -> None:
        """Go on with what is being uploaded."""
        what = "fence" if self.state == FENCING else "mission"
        upload.tick(now)
        if upload.problem is not None:
            self._told.since(what, f"the autopilot does not take its {what}: {upload.problem}; trying again")
            if now - self._entered > _PAUSE:
                self._begin(now)
        elif upload.done and self.state == FENCING:
            self._told.over(what)
            self._told.say(f"the autopilot has its fence: {len(self._fence)} vertices")
            self._fence = ()
            self._begin(now)
        elif upload.done:
            self._told.over(what)
            self._enter(CHOOSING, now)

    def _begin(self, now: float) -> None:
        """Upload the fence, if that is to be done yet, else the mission."""
        if self._fence:
            self._upload = Upload(self._fence, self._autopilot.send, FENCE)
            self._upload.begin(now)
            self._enter(FENCING, now)
            return
        autopilot, choice = self._autopilot, self._choice
        px4 = autopilot.family(self._told_kind) == PX4
        home = np.array([autopilot.longitude, autopilot.latitude])
        items, self._first = items_of(home, self._waypoints, choice.speed(), choice.vehicle, px4=px4)
        self._upload = Upload(items, autopilot.send)
        self._upload.begin(now)
        self._enter(UPLOADING, now)

    def _may_start(self, modes: Modes) -> bool:
        """Whether a person has armed it, and put it into the mode in which it holds."""
        if not self._autopilot.armed:
            self._told.since("armed", "not armed: arm it; it goes then")
            return False
        self._told.over("armed")
        if self._autopilot.custom != modes.hold.custom:
            self._told.since("steered", f"steered by somebody: put it into {modes.hold.name}; it goes then")
            return False
        self._told.over("steered")
        return True

    def _asked_before(self, now: float) -> bool:
        """Whether what this state asks for was sent before that time."""
        return -math.inf < self._sent < now

    def _enter(self, state: int, now: float) -> None:
        self.state, self._sent, self._entered = state, -math.inf, now
        self._autopilot.refused = None

    def _repeat(self, now: float, send: Callable[[], None]) -> None:
        """Send something now, and again where it has had no effect."""
        if now - self._sent >= _REPEAT:
            self._sent = now
            send()
