"""An autopilot for tests, and a radio link that loses, doubles and delays messages; time is a number."""

import heapq
import itertools
import math
import random
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from maipp.fleet.mavlink.link import COMPONENT, StampedMessage
from maipp.fleet.mavlink.modes import ARDUPILOT, PX4

METRE = 1 / 111_320.0  # degrees of latitude


class Radio:
    """Both directions of a link. What is sent arrives later, twice, or not at all."""

    def __init__(self, seed=0, loss=0.0, double=0.0, delay=0.02):
        self.random, self.loss, self.double, self.delay = random.Random(seed), loss, double, delay
        self.time, self.number = 0.0, itertools.count()
        self.ways: dict[str, list[Any]] = {"up": [], "down": []}
        self.sent = dict.fromkeys(self.ways, 0)
        self.cut = False

    def put(self, way, data):
        """Send bytes `up` to the autopilot, or `down`."""
        self.sent[way] += 1
        for _ in range(1 + (self.random.random() < self.double)):
            if not self.cut and self.random.random() >= self.loss:
                due = self.time + self.delay * (0.5 + self.random.random())
                heapq.heappush(self.ways[way], (due, next(self.number), bytes(data)))

    def get(self, way):
        """What has arrived by now."""
        arrived = []
        while self.ways[way] and self.ways[way][0][0] <= self.time:
            arrived.append(heapq.heappop(self.ways[way])[2])
        return arrived


class Wire:
    """What pymavlink writes its messages to."""

    def __init__(self, radio, way):
        self.radio, self.way = radio, way

    def write(self, data):
        self.radio.put(self.way, data)


class Channel:
    """The vehicle's end of the radio."""

    def __init__(self, radio, clock, source=245):
        self.radio, self.clock, self.closed = radio, clock, False
        self.mav = dialect.MAVLink(Wire(radio, "up"), srcSystem=source, srcComponent=COMPONENT)
        self.names: list[str] = []

    def send(self, name, *fields):
        self.names.append(name)
        getattr(self.mav, f"{name}_send")(*fields)

    def take(self):
        heard = [message for data in self.radio.get("down") for message in self.mav.parse_buffer(data) or []]
        return [StampedMessage(message, self.clock.now(), self.radio.time) for message in heard]

    def close(self):
        self.closed = True


class ScriptedAutopilot:
    """It takes missions as ArduPilot (item 0 is home, items are stored as they come) or as PX4 (all or nothing)."""

    REQUEST_AGAIN, GIVE_UP = 1.0, 8.0  # s, as ArduPilot's

    def __init__(self, radio, kind=ARDUPILOT, longitude=10.0, latitude=0.0, speed=2.0, mode=5, auto=10):
        self.radio, self.kind, self.x, self.y, self.speed = radio, kind, longitude, latitude, speed
        self.mode, self.auto, self.armed, self.refuses = mode, auto, True, False
        self.mav = dialect.MAVLink(Wire(radio, "down"), srcSystem=1, srcComponent=1)
        self.mission: list[Any] = []
        self.fence: list[Any] = []
        self.kind_coming = 0  # of an upload: mission or fence
        self.refuses_fence = False
        self.current, self.finished = 0, True
        self.expected = self.asked = 0  # items of an upload under way; 0: none
        self.coming: list[Any] = []
        self.since = self.begun = 0.0
        self.peer = (0, 0)
        self.starts: list[tuple[list[Any], int]] = []  # mission and current item each time it was told to go
        self.due = {"beat": 0.0, "position": 0.0, "current": 0.0, "value": 0.0}
        self.value = lambda x, y: 0.0
        self.silent = set()  # of messages that are never sent
        self.odometer = 0.0
        self.nearby = 0.0  # metres from a waypoint at which it is there

    def step(self, seconds):
        """Go on for that long."""
        for data in self.radio.get("up"):
            for message in self.mav.parse_buffer(data) or []:
                getattr(self, f"on_{message.get_type().lower()}", lambda message: None)(message)
        now = self.radio.time
        if self.expected:
            if now - self.begun > self.GIVE_UP:
                self.expected = 0
                self.say("mission_ack", *self.peer, 15, self.kind_coming)
            elif now - self.since > self.REQUEST_AGAIN:
                self.ask()
        self.travel(seconds)
        for what, every in (("beat", 1.0), ("position", 0.2), ("current", 1.0), ("value", 0.5)):
            if now >= self.due[what]:
                self.due[what] = now + every
                getattr(self, f"tell_{what}")()

    def say(self, name, *fields):
        if name not in self.silent:
            getattr(self.mav, f"{name}_send")(*fields)

    def tell_beat(self):
        self.say("heartbeat", 11, self.kind, 1 | 128 * self.armed, self.mode, 4)

    def tell_position(self):
        at = round(self.y * 1e7), round(self.x * 1e7)
        self.say("global_position_int", int(self.radio.time * 1e3), *at, 0, 0, 0, 0, 0, 0)

    def tell_current(self):
        self.say("mission_current", self.current)

    def tell_value(self):
        self.say("named_value_float", int(self.radio.time * 1e3), b"turbidity", self.value(self.x, self.y))

    @property
    def following(self):
        """Whether it goes along its mission."""
        return self.armed and self.mode == self.auto and not self.finished

    def travel(self, seconds):
        """Along the mission, item by item."""
        way = self.speed * seconds
        while self.following and way > 0:
            if self.current >= len(self.mission):
                self.finished = True
                return
            item = self.mission[self.current]
            if item.command == 178:
                self.speed, self.current = item.param2, self.current + 1
                continue
            east, north = (item.y / 1e7 - self.x) / METRE, (item.x / 1e7 - self.y) / METRE
            gap = math.hypot(east, north)
            step = min(way, max(gap - self.nearby, 0.0))
            if step > 0:
                self.x, self.y = self.x + east / gap * step * METRE, self.y + north / gap * step * METRE
                self.odometer, way = self.odometer + step, way - step
            if gap - step > self.nearby:
                return
            self.say("mission_item_reached", self.current)
            self.current += 1

    def on_mission_count(self, message):
        self.peer, self.kind_coming = (message.get_srcSystem(), message.get_srcComponent()), message.mission_type
        self.expected, self.asked, self.begun, self.coming = message.count, 0, self.radio.time, []
        if self.kind == ARDUPILOT and not self.kind_coming:
            self.mission = self.mission[: message.count]
        self.ask()

    def on_mission_clear_all(self, message):
        if message.mission_type:
            self.fence, self.expected = [], 0
        else:
            self.mission, self.expected, self.finished = [], 0, True
        self.say("mission_ack", message.get_srcSystem(), message.get_srcComponent(), 0, message.mission_type)

    def ask(self):
        self.since = self.radio.time
        name = "mission_request" if self.kind == ARDUPILOT else "mission_request_int"
        self.say(name, *self.peer, self.asked, self.kind_coming)

    def on_mission_item_int(self, message):
        if not self.expected or message.mission_type != self.kind_coming:
            return
        if message.seq != self.asked:
            if self.kind == ARDUPILOT:
                self.say("mission_ack", *self.peer, 13, self.kind_coming)
            else:
                self.ask()
            return
        if self.refuses_fence if self.kind_coming else self.refuses:
            self.expected = 0
            self.say("mission_ack", *self.peer, 14, self.kind_coming)
            return
        self.begun = self.radio.time
        if self.kind == ARDUPILOT and not self.kind_coming:
            self.mission[message.seq :] = [message]
        self.coming.append(message)
        self.asked += 1
        if self.asked < self.expected:
            self.ask()
            return
        self.expected = 0
        if self.kind_coming:
            self.fence = self.coming
        else:
            self.mission = self.coming
        self.say("mission_ack", *self.peer, 0, self.kind_coming)

    def on_mission_set_current(self, message):
        if message.seq < len(self.mission):
            self.current, self.finished = message.seq, False
        self.tell_current()

    def on_command_long(self, message):
        if message.command != 176:
            return
        mode = int(message.param2) if self.kind == ARDUPILOT else int(message.param2) << 16 | int(message.param3) << 24
        if mode == self.auto and self.mode != self.auto:
            self.starts.append((list(self.mission), self.current))
        self.mode = mode
        self.say("command_ack", 176, 0)


assert PX4 != ARDUPILOT
