"""What is known of an autopilot by its messages, and what can be asked of it."""

import math
from collections.abc import Callable
from typing import Any

from maipp.fleet.mavlink.link import COMPONENT, StampedMessage
from maipp.fleet.mavlink.modes import ARDUPILOT, PX4, Mode

_AUTOPILOT, _NO_AUTOPILOT = 1, 8  # MAV_COMP_ID_AUTOPILOT1, MAV_AUTOPILOT_INVALID
_ARMED, _CUSTOM = 128, 1  # MAV_MODE_FLAG
_SET_MODE, _SET_INTERVAL = 176, 511  # MAV_CMD
_POSITION, _CURRENT = 33, 42  # GLOBAL_POSITION_INT, MISSION_CURRENT
_OFTEN, _SELDOM = 2e5, 1e6  # microseconds from one to the next
_SCALE = 1e7
_REFUSED = {1: "not now", 2: "denied", 3: "not supported", 4: "failed"}  # MAV_RESULT


class Autopilot:
    """Takes up messages in the order in which they come; those of other systems, and for others, are left out."""

    def __init__(self, system: int, source: int, send: Callable[..., None]) -> None:
        """Of that `system`, 0 for the first that is heard; `source` is this system's own number."""
        self.system, self._source, self._send_to = system, source, send
        self.kind: int | None = None  # MAV_AUTOPILOT; None: not heard yet
        self.armed = False
        self.custom = -1  # mode
        self.beat = -math.inf  # monotonic time of the last heartbeat
        self.longitude = self.latitude = math.nan
        self.position_time, self.position_now = -math.inf, -math.inf  # the survey's, and monotonic
        self.current: tuple[int, float] | None = None  # number of the mission's item, monotonic time
        self.refused: str | None = None  # why it did not change its mode

    def hear(self, heard: StampedMessage) -> bool:
        """Take up a message; whether it is of this autopilot, and for everybody or this system."""
        message, kind = heard.message, heard.message.get_type()
        if kind == "HEARTBEAT" and message.get_srcComponent() == _AUTOPILOT and message.autopilot != _NO_AUTOPILOT:
            self.system = self.system or message.get_srcSystem()
            if message.get_srcSystem() == self.system:
                self.kind, self.custom, self.beat = message.autopilot, message.custom_mode, heard.now
                self.armed = bool(message.base_mode & _ARMED)
        if message.get_srcSystem() != self.system or not self._for_us(message):
            return False
        if kind == "GLOBAL_POSITION_INT" and (message.lat, message.lon) != (0, 0):  # which stands for none
            self.longitude, self.latitude = message.lon / _SCALE, message.lat / _SCALE
            self.position_time, self.position_now = heard.time, heard.now
        elif kind == "MISSION_CURRENT":
            self.current = message.seq, heard.now
        elif kind == "COMMAND_ACK" and message.command == _SET_MODE:
            self.refused = _REFUSED.get(message.result)
        return True

    def family(self, told: int) -> int:
        """ARDUPILOT or PX4: what it says that it is, or else what one was `told`."""
        return self.kind if self.kind in (ARDUPILOT, PX4) else told

    def send(self, name: str, *fields: Any) -> None:
        """Send it a message, whose first fields are its system and component."""
        self._send_to(name, self.system, _AUTOPILOT, *fields)

    def set_mode(self, mode: Mode) -> None:
        """Ask for a mode; whether it comes is in the next heartbeat."""
        self.refused = None
        self.send("command_long", _SET_MODE, 0, _CUSTOM, *mode.parameters, 0, 0, 0, 0)

    def ask_for_positions(self) -> None:
        """Ask to be told where it is, and at which item of its mission."""
        for message, interval in ((_POSITION, _OFTEN), (_CURRENT, _SELDOM)):
            self.send("command_long", _SET_INTERVAL, 0, message, interval, 0, 0, 0, 0, 0)

    def _for_us(self, message: Any) -> bool:
        system, component = (getattr(message, f"target_{part}", 0) for part in ("system", "component"))
        return system in (0, self._source) and component in (0, COMPONENT)
