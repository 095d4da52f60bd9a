"""One that takes part in a fleet: all logs that it has heard of, and the survey that they make up.

It stands on its own: whatever it hears of the others it hears through its transport, and without them it goes on.
"""

import struct
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from maipp.errors import InputError
from maipp.fleet.exchange import HAVE, LINE, Exchange
from maipp.fleet.log import Origin
from maipp.fleet.logs import Logs
from maipp.fleet.transport import Hint, Transport
from maipp.live.events import Event, Heard, Joined, Zone
from maipp.live.robot_state import WAITING
from maipp.live.team import TeamSurvey

INTENT = "intent"
_INTENT = struct.Struct("<dff")  # time, position in domain units; then the message
_MOST_WAITING = 10_000  # records that name robots which are not known


@dataclass(frozen=True)
class Pace:
    """How often a robot speaks, and how long it waits, in seconds of its computer."""

    beat: float = 1.0  # from one "I am here" to the next
    round: float = 5.0  # from one exchange of logs to the next
    answer: float = 1.0  # that an answer may take
    contact: float = 3.0  # for so long who was heard counts as within reach
    turn: float = 3.0  # that a robot waits at most for others who are deciding at the same moment
    silent: float = 30.0  # after so long without a word a robot is said to be silent


class Member:
    """Keeps up with the others. Used from one thread, but for what it serves."""

    def __init__(
        self,
        survey: TeamSurvey,
        logs: Logs,
        transport: Transport,
        *,
        status: Callable[[], dict[str, Any]] = dict,
        changed: Callable[[Event], object] = lambda event: None,
        monotonic: Callable[[], float],
        pace: Pace | None = None,
        tell: Callable[[str], None] = print,
    ) -> None:
        """Take up what the logs hold. `changed` is called with each event of another that has been taken over."""
        self.survey, self.logs, self.transport = survey, logs, transport
        self.pace, self._monotonic, self._tell, self._changed = pace or Pace(), monotonic, tell, changed
        self.heard: dict[str, float] = {}  # when each was last heard
        self._since, self._silent = monotonic(), set[str]()
        self._next = dict.fromkeys(("beat", "round"), self._since)
        self._ask: dict[str, float] = {}  # whom to ask for what is missing, and not before when
        self._waiting: list[tuple[Origin, dict[str, Any]]] = []  # records that name what is not known yet
        self._own = None if logs.origin is None else logs.origin.robot
        self.exchange = Exchange(
            logs, transport, lambda: status() | {"hears": self.hears}, self._taken, tell, monotonic
        )
        for origin, record in logs.records():
            self._take(origin, record)

    # What comes from others.

    def listen(self) -> None:
        """Take in what has come, and fetch what is found to be missing."""
        for hint in self.transport.receive():
            self._hear(hint)
        now = self._monotonic()
        for name in [name for name, when in self._ask.items() if when <= now]:
            del self._ask[name]
            if self.exchange.behind(name):
                self.meet(name)

    def meet(self, name: str | None = None) -> set[str]:
        """Exchange logs with one, or with all within reach; those of the team that answered."""
        answered = self.exchange.round(self.pace.answer, name)
        for each in answered:
            self._note(each)
        return answered & {*self.survey.names}

    def phase(self, name: str) -> str:
        """What a robot said last of its turn to decide."""
        news = self.exchange.news.get(name)
        return "" if news is None else str(news.status.get("phase", ""))

    def keep_up(self) -> None:
        """Say that one is here, exchange logs, and tell who has fallen silent, each in its time."""
        now = self._monotonic()
        if now >= self._next["beat"]:
            self._next["beat"] = now + self.pace.beat
            self.exchange.beat()
        if now >= self._next["round"]:
            self._next["round"] = now + self.pace.round
            self.meet()
        for name in self.survey.names:
            silence = now - self.heard.get(name, self._since)
            if silence > self.pace.silent and name not in self._silent and name != self._own:
                self._silent.add(name)
                self._tell(f"{name} is silent: not heard for {silence:.0f} s; not counted on until it is heard again")

    def within_reach(self, answered: set[str]) -> frozenset[str]:
        """Of the team, those that answered, and those heard a moment ago."""
        now = self._monotonic()
        lately = {name for name, when in self.heard.items() if now - when < self.pace.contact}
        return frozenset((answered | lately) & {*self.survey.names})

    @property
    def hears(self) -> list[str]:
        """Of the team, those heard a moment ago; from any thread."""
        now, names = self._monotonic(), self.survey.names
        return sorted(name for name, when in [*self.heard.items()] if now - when < self.pace.contact and name in names)

    @property
    def silent(self) -> frozenset[str]:
        """Robots that have not been heard for long."""
        return frozenset(self._silent)

    def announce_intent(self) -> None:
        """Tell whoever hears it what the robot of this log means to do."""
        robot = self.survey.robot(self._own or "")
        content = b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(robot.message))
        self.transport.publish(INTENT, _INTENT.pack(robot.time, *robot.position.tolist()) + content)

    def _hear(self, hint: Hint) -> None:
        if hint.topic == HAVE:
            if self.exchange.hear_news(hint.sender, hint.payload):
                if self.exchange.behind(hint.sender):
                    self._ask_soon(hint.sender)
                self._note(hint.sender)
        elif hint.topic == LINE:
            if not self.exchange.hear_line(hint.sender, hint.payload):
                self._ask_soon(hint.sender, missing=True)
            self._note(hint.sender)
        elif hint.topic == INTENT and hint.sender in self.survey.names and hint.sender != self._own:
            self._hear_intent(hint.sender, hint.payload)
            self._note(hint.sender)

    def _ask_soon(self, name: str, missing: bool = False) -> None:
        """Ask somebody for what is missing; of several lines in a row that are, once."""
        if missing:
            self.exchange.expect(name)
        self._ask.setdefault(name, self._monotonic() + 0.2 * self.pace.beat)

    def _note(self, name: str) -> None:
        now = self._monotonic()
        if name in self._silent:
            self._silent.discard(name)
            self._tell(f"{name} is heard again")
        self.heard[name] = now

    def _hear_intent(self, sender: str, payload: bytes) -> None:
        try:
            if len(payload) < _INTENT.size:
                raise ValueError("an intent that is cut short")
            time, x, y = _INTENT.unpack_from(payload)
            units = self.survey.setup.units
            if not np.isfinite([time, x, y]).all():
                raise ValueError("an intent of no time or place")
            robot = self.survey.robot(sender)
            if time <= robot.latest and robot.status != WAITING:
                return
            (position,) = units.points_out(np.array([[x, y]]))
            packed = b64encode(payload[_INTENT.size :]).decode("ascii")
            told = Heard("intent", sender, (position[0], position[1]), units.time_out(time), packed)
            self.survey.overhear(told)
        except ValueError as error:  # InputError is one
            self.exchange.refuse(sender, error)

    # What becomes of records.

    def _taken(self, origin: Origin, records: list[dict[str, Any]]) -> None:
        for record in records:
            self._take(origin, record)

    def _take(self, origin: Origin, record: dict[str, Any]) -> None:
        """Take over a record, and those that were waiting for it."""
        event = self._try(origin, record)
        if isinstance(event, Joined):
            waiting, self._waiting = self._waiting, []
            for each in waiting:
                self._try(*each)

    def _is_early(self, record: dict[str, Any]) -> bool:
        """Whether a record is of a robot that has joined, as is not known here yet."""
        event = record.get("event")
        robot = event.get("robot") if isinstance(event, dict) else None
        return isinstance(robot, str) and robot not in self.survey.names

    def _try(self, origin: Origin, record: dict[str, Any]) -> Event | None:
        try:
            event = self.survey.take(record, origin.robot)
        except InputError as error:
            if self._is_early(record) and len(self._waiting) < _MOST_WAITING:
                self._waiting.append((origin, record))
            else:
                told = ValueError(f"{origin}: line {record.get('seq')}: {error}; not taken over")
                self.exchange.refuse(origin.robot, told)
            return None
        if event is not None and origin.robot != self._own:
            self._changed(event)
        return event


def is_zone(event: Event) -> bool:
    """Whether from this event on a place may not be entered."""
    return isinstance(event, Zone) and event.polygon is not None
