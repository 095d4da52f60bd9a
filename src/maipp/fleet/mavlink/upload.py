"""The upload of a mission (MAVLink's mission protocol), as a state machine: the autopilot asks for item after item."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from maipp.route_files.qgc_plan import MissionItem

Send = Callable[..., None]  # name of a message, and its fields behind the target's system and component

MISSION, FENCE = 0, 1  # MAV_MISSION_TYPE
_TIMEOUT, _RETRIES, _ATTEMPTS = 1.5, 5, 3  # s; as the protocol's description has it, and from the start so often

# MAV_MISSION_RESULT
_ACCEPTED, _OUT_OF_ORDER, _CANCELLED = 0, 13, 15
_RESULTS = {
    1: "an error",
    2: "its frame is not supported",
    3: "a command is not supported",
    4: "there is no space for it",
    5: "an item is invalid",
    14: "it is denied, as waypoints outside of the autopilot's fence are",
}
_SCALE = 1e7  # degrees in a message's integers


class Upload:
    """One upload. `done` once the autopilot has accepted the mission, `problem` once it will not have it."""

    def __init__(self, items: Sequence[MissionItem], send: Send, kind: int = MISSION) -> None:
        self._items, self._send, self._kind = list(items), send, kind
        self.done = False
        self.problem: str | None = None
        self.resumed = False  # after it was done the autopilot asked again, and accepted again
        self._next = 0  # the item asked for last, plus 1
        self._asked_late, self._clearing = False, False
        self._attempt, self._tries, self._since = 0, 0, -math.inf

    def begin(self, now: float) -> None:
        """Say how many items there are; what was sent before counts no more."""
        self._next, self._tries, self._since, self._clearing = 0, 0, now, False
        self._send("mission_count", len(self._items), self._kind)

    def hear(self, message: Any, now: float) -> None:
        """Take up a message of the autopilot that is for this system."""
        kind = message.get_type()
        if kind not in ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"):
            return
        if getattr(message, "mission_type", MISSION) != self._kind or self.problem is not None:
            return
        if kind == "MISSION_ACK":
            self._acknowledged(message.type, now)
        elif message.seq < len(self._items) and not self._clearing:
            # As often as it is asked for: the answer may have been lost, or the request doubled.
            self._next = max(self._next, message.seq + 1)
            self._asked_late |= self.done
            self._tries, self._since = 0, now
            self._item(message.seq)

    def tick(self, now: float) -> None:
        """Send again what has had no answer."""
        if self.done or self.problem is not None or now - self._since < _TIMEOUT:
            return
        self._tries, self._since = self._tries + 1, now
        if self._tries > _RETRIES:
            self._again("it does not answer", now)
        elif self._clearing:
            self._send("mission_clear_all", self._kind)
        elif self._next:
            self._item(self._next - 1)
        else:
            self._send("mission_count", len(self._items), self._kind)

    def _acknowledged(self, result: int, now: float) -> None:
        if result == _ACCEPTED:
            if self._clearing:
                self.begin(now)
            elif self._next >= len(self._items):  # before everything was asked for, it is of an earlier upload
                self.resumed |= self.done and self._asked_late
                self.done = True
        elif result == _OUT_OF_ORDER or self.done or self._clearing:
            return  # it minds an item that came twice, and goes on asking
        elif result == _CANCELLED:
            self._again("it gave up waiting", now)
        else:
            self._again(_RESULTS.get(result, f"item refused with MAV_MISSION_RESULT {result}"), now, clear=True)

    def _again(self, reason: str, now: float, *, clear: bool = False) -> None:
        """Begin anew, unless that has been tried; where something was refused, with nothing stored."""
        self._attempt += 1
        if self._attempt >= _ATTEMPTS:
            self.problem = reason
            return
        if not clear:
            self.begin(now)
            return
        self._tries, self._since, self._clearing = 0, now, True
        self._send("mission_clear_all", self._kind)

    def _item(self, number: int) -> None:
        item = self._items[number]
        *own, x, y, z = (math.nan if value is None else float(value) for value in item.parameters)
        place = (round(x * _SCALE), round(y * _SCALE))
        current = int(number == 0 and self._kind == MISSION)
        head = (number, item.frame, item.command, current, 1)
        self._send("mission_item_int", *head, *own, *place, z, self._kind)
