"""The robot of a fleet: its vehicle, what it reports, and what it decides from all that it has heard."""

import math
from collections.abc import Callable
from typing import Any

from maipp.errors import InputError
from maipp.fleet.clock import Clock
from maipp.fleet.decision_order import DecisionOrder
from maipp.fleet.log import Origin
from maipp.fleet.logs import DiskError, Logs, LogSegment
from maipp.fleet.member import Member, Pace, is_zone
from maipp.fleet.transport import Transport
from maipp.fleet.vehicle import Answered, Fix, Reached, Reading, Report, Vehicle
from maipp.live.events import Event, read_event
from maipp.live.robot_state import STOPPED
from maipp.live.team import TeamSurvey

# Reasons to stop after which nothing more is to be done.
_ENDS = ("budget", "home")
_PATIENCE = 1.0  # s from a try to report an arrival to the next


class Robot:
    """One robot, on a computer of its own or in a simulation. Used from one thread, but for what it serves."""

    def __init__(
        self,
        survey: TeamSurvey,
        logs: Logs,
        transport: Transport,
        vehicle: Vehicle,
        clock: Clock,
        *,
        monotonic: Callable[[], float] | None = None,
        pace: Pace | None = None,
        tell: Callable[[str], None] = print,
    ) -> None:
        """Take up what the logs hold; `monotonic` are the seconds that `pace` counts, the clock's if left out."""
        assert logs.origin is not None
        self.origin: Origin = logs.origin
        self.survey, self.logs, self.vehicle, self.clock, self._tell = survey, logs, vehicle, clock, tell
        self.done = False  # it has stopped for good
        self.answer: dict[str, Any] | None = None  # what it was told last
        self._fix: Fix | None = None
        self._reports: list[Report] = []  # of the vehicle, not dealt with yet
        self._told_once = set[str]()  # what is wrong with the disk
        self._monotonic = monotonic or clock.now
        self.turn = DecisionOrder(self.name, survey.names, (pace or Pace()).turn, self._monotonic)
        self._holds, self._not_before = False, -math.inf
        self._again = False  # it has to ask for another way
        survey.keep_in(self._keep)
        self.member = Member(
            survey,
            logs,
            transport,
            status=self.status,
            changed=self._of_another,
            monotonic=self._monotonic,
            pace=pace,
            tell=tell,
        )

    @property
    def name(self) -> str:
        """Of the robot."""
        return self.origin.robot

    def status(self) -> dict[str, Any]:
        """What it says of itself; from any thread."""
        fix, answer = self._fix, self.answer
        told: dict[str, Any] = {"done": self.done, "phase": self.turn.phase}
        if fix is not None:
            told |= {"time": fix.time, "position": list(fix.position)}
        return told | ({} if answer is None else {"answer": answer["answer"]})

    def begin(self) -> None:
        """Go on where the log ends: hold, say where it is, and ask for a way, unless nothing is left to do."""
        own = self.survey.robot(self.name)
        if own.status == STOPPED and own.answer is not None and own.answer.get("reason") in _ENDS:
            self.answer, self.done = own.answer, True
            self._tell(f"done: {own.answer['reason']}")
            return
        self._again = True

    def work(self) -> None:
        """Whatever is due."""
        self.member.listen()
        self.member.keep_up()
        self.measure()
        self.decide()

    def measure(self) -> None:
        """Report what the vehicle has measured, and what else there is to say, but for its arrival."""
        self._reports += self.vehicle.poll()
        while self._reports and not isinstance(self._reports[0], Reached):
            if not self._told(self._reports[0]):
                return
            del self._reports[0]

    @property
    def asks(self) -> bool:
        """Whether it is waiting for a way."""
        return self._again or (bool(self._reports) and isinstance(self._reports[0], Reached))

    @property
    def asks_at(self) -> float:
        """The time from which it has been waiting for a way."""
        first = None if self._again or not self._reports else self._reports[0]
        return first.time if isinstance(first, Fix) else self.clock.now()

    def decide(self) -> None:
        """If it is at the end of its way, or has to have another one: hear the others, decide, go."""
        if not self.asks or self._monotonic() < self._not_before:
            return
        if self._again and not self._holds:
            self.vehicle.hold()
            self._holds = True
        self.turn.ask()
        answered = self.member.meet()
        if self.turn.is_due({name: self.member.phase(name) for name in answered}):
            try:
                self._decide(answered)
            finally:
                self.turn.end()

    def _decide(self, answered: set[str]) -> None:
        fix = self.vehicle.where()
        self.survey.within_reach = self.member.within_reach(answered)
        try:
            answer = self.survey.report(self._event("arrived", fix))
        except DiskError as error:
            self._tell_once(f"holding: {error}")
            self._later()
            return
        except InputError as error:  # as where it is far off, or has no fix yet
            self._tell_once(f"holding, since this is no arrival: {error}")
            answer = _refusal(error)
            self._later()
        arrived = [report for report in self._reports if isinstance(report, Reached)]
        self._reports = [report for report in self._reports if not isinstance(report, Reached)]
        for report in arrived:
            self._answer(report, answer)
        if answer["answer"] != "error":
            self._again = self._holds = False
            self.member.announce_intent()
            self._act(answer)

    def _later(self) -> None:
        """Ask again in a while, from where it is then."""
        self._again, self._not_before = True, self._monotonic() + _PATIENCE

    def _act(self, answer: dict[str, Any]) -> None:
        """Do as one is told."""
        self.answer = answer
        if answer["answer"] in ("go", "home"):
            ways = [[(x, y) for x, y in answer[key]] for key in ("waypoints", "measure")]
            self.vehicle.go(*ways, home=answer["answer"] == "home")
            self.done = False
            self._tell(f"{answer['answer']}: {len(ways[0])} waypoints, {len(ways[1])} measurements on the way")
        elif answer["answer"] == "stop":
            self.vehicle.hold()
            self.done = True
            self._tell(f"done: {answer['reason']}")

    def _answer(self, report: Report, answer: dict[str, Any]) -> None:
        """Let the vehicle know what became of its report."""
        if isinstance(self.vehicle, Answered):
            self.vehicle.answered(report, answer)

    def _told(self, report: Report) -> bool:
        """Report one thing; False where that has to wait."""
        try:
            if isinstance(report, Reading):
                event = self._event("measurement", report, value=report.value)
                self._answer(report, self.survey.report(event))
            elif not isinstance(report, Fix):
                head = {"id": self._new_id(), "robot": self.name, "time": self.clock.now()}
                self._wish(report, {**head, **report.event})
        except DiskError as error:
            self._tell_once(f"waiting to write down what was measured: {error}")
            return False
        except InputError as error:
            self._tell(f"not reported: {error}")
            self._answer(report, _refusal(error))
        return True

    def _wish(self, report: Report, values: dict[str, Any]) -> None:
        if values.get("event") in ("zone", "threshold"):
            del values["robot"]
        event = read_event(values, [self.name])
        answer = self.survey.report(event)
        self._answer(report, answer)
        if answer["answer"] == "home":
            self._act(answer)
        elif is_zone(event):
            self._again = True

    def _of_another(self, event: Event) -> None:
        if is_zone(event) and not self.done:
            self._again = True

    def _tell_once(self, text: str) -> None:
        """Tell what will be so for a while."""
        if text not in self._told_once:
            self._told_once.add(text)
            self._tell(text)

    def _event(self, kind: str, fix: Fix, **more: float) -> Event:
        """The event of what a vehicle tells, checked as strictly as what comes from outside."""
        told = {"event": kind, "id": self._new_id(), "robot": self.name, "position": list(fix.position)}
        told |= {"time": fix.time} | more | ({} if fix.travelled is None else {"travelled": fix.travelled})
        event = read_event(told, [self.name])
        self._fix = fix
        return event

    def _new_id(self) -> str:
        """An id that no other event has: the place of its line."""
        return f"{self.origin}.{max(self.logs.length(self.origin), 1)}"

    def _keep(self, record: dict[str, Any]) -> None:
        part: LogSegment = self.logs.append(record)
        self._told_once.clear()
        self.member.exchange.announce(part)


def _refusal(error: InputError) -> dict[str, Any]:
    return {"answer": "error", "problem": " ".join(str(error).split())}
