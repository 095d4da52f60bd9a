"""`--vehicle lines`: whatever a bridge drives, over the JSON lines of `maipp live` on standard input and output."""

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from maipp.errors import InputError
from maipp.fleet.clock import Clock
from maipp.fleet.line_reports import read_report
from maipp.fleet.line_streams import LineInput, LineOutput
from maipp.fleet.vehicle import Fix, Place, Reached, Reading, Report, Wish
from maipp.fleet.vehicles import VehicleContext as Made
from maipp.fleet.vehicles import numbers
from maipp.live.request import LONGEST_ID, PROTOCOL, parse_line
from maipp.live.serve import encode
from maipp.live.units import Units

OPTIONS = {"wait": 5.0}

_AT_ONCE = 200  # lines dealt with in one call
_REMEMBERED = 10_000  # ids of lines that may be sent again
_OLD = 10.0  # s after which it is told that a position under way is old
_AHEAD = 60.0  # s that the bridge's clock may be ahead
_STOP: dict[str, Any] = {"answer": "stop", "reason": "hold"}


def make(place: Made, options: Mapping[str, str]) -> "Lines":
    """The vehicle; options: wait (docs/vehicles.md). Raises `InputError` for one that is unknown or wrong.

    It waits so many seconds for the bridge to say where the robot is.
    """
    wait = numbers(options, OPTIONS)["wait"]
    if not 0 <= wait <= 3600:
        raise InputError(f"--with wait={wait:g}: give seconds, from 0 to 3600")
    units, robot = place.survey.setup.units, place.robot

    def presumed() -> Fix:
        """Where the robot is by what its log says."""
        now = place.clock.now()
        (point,) = units.points_out(np.asarray(place.survey.robot(robot).where(units.time("time", now)))[None])
        return Fix(now, (point[0], point[1]))

    gated = place.survey.setup.gate > 0
    vehicle = Lines(robot, units, place.clock, presumed, place.tell, LineInput(), LineOutput(), gated=gated)
    if wait and not vehicle.wait_for_position(wait):
        place.tell(f"the bridge has not said where {robot} is in {wait:g} s: taken to be where its log has it")
    return vehicle


class Lines:
    """A `Vehicle` that a bridge on the other side of two streams drives."""

    def __init__(
        self,
        robot: str,
        units: Units,
        clock: Clock,
        presumed: Callable[[], Fix],
        tell: Callable[[str], None],
        source: LineInput,
        sink: LineOutput,
        *,
        gated: bool = True,
    ) -> None:
        """`presumed` says where the robot is until the bridge says so; with `gated` values of any size pass."""
        self._robot, self._units, self._clock, self._presumed, self._tell = robot, units, clock, presumed, tell
        self._source, self._sink, self._gated = source, sink, gated
        self._fix: Fix | None = None
        self._command = _STOP  # what it was told last
        self._reports: list[Report] = []
        self._seen: OrderedDict[str, tuple[str, dict[str, Any] | None]] = OrderedDict()  # line, its answer, by its id
        self._unanswered: OrderedDict[int, tuple[Report, str | None]] = OrderedDict()  # by identity; the line's id
        self._asked: str | None = None  # id of the arrival that is being decided
        self._told: set[str] = set()
        self._write({"answer": "ready", "protocol": PROTOCOL, "robot": robot, "units": units.names})

    def wait_for_position(self, seconds: float) -> bool:
        """Whether the bridge says where the robot is within that time."""
        while self._fix is None and seconds > 0 and not self._source.ended:
            self._source.wait(0.1)
            self._read()
            seconds -= 0.1
        return self._fix is not None

    def where(self) -> Fix:
        """As the protocol has it: where the bridge says that it is."""
        self._read()
        now = self._clock.now()
        if self._fix is None:
            return self._presumed()
        fix = self._fix
        if self._command["answer"] != "stop" and now - fix.time > _OLD:
            told = f"no position of {self._robot} for {now - fix.time:.0f} s; the bridge should send one every second"
            self._tell_once("position", told)
        return Fix(max(now, fix.time), fix.position, fix.travelled)

    def go(self, waypoints: Sequence[Place], measure: Sequence[Place], *, home: bool = False) -> None:
        """As the protocol has it."""
        way = {"waypoints": [list(point) for point in waypoints], "measure": [list(point) for point in measure]}
        self._order({"answer": "home" if home else "go"} | way)

    def hold(self) -> None:
        """As the protocol has it; told once."""
        if self._command["answer"] != "stop":
            self._order(_STOP)

    def poll(self) -> list[Report]:
        """As the protocol has it."""
        self._read()
        reports, self._reports = self._reports, []
        return reports

    def answered(self, report: Report, answer: Mapping[str, Any]) -> None:
        """What became of a report; its `id`, if any, is that in the log."""
        _, name = self._unanswered.pop(id(report), (report, None))
        if isinstance(report, Reached) and answer["answer"] != "error":
            self._asked = name  # the answer is where to go
            if answer["answer"] == "stop":
                self._order({"answer": "stop", "reason": answer.get("reason", "hold")})
            return
        rest = {key: value for key, value in answer.items() if key not in ("answer", "id")}
        event = {"event": answer["id"]} if "id" in answer else {}
        told = {"answer": "noted" if event else "error", "id": name} | event | rest
        if name in self._seen:
            self._seen[name] = self._seen[name][0], told
        self._write(told, always=False)

    def close(self) -> None:
        """As the protocol has it."""
        self.hold()
        self._sink.close()

    def _read(self) -> None:
        """Take up what the bridge has sent."""
        before = self._source.ended
        for number, line in self._source.take(_AT_ONCE):
            name = None
            try:
                values = parse_line(line)
                name = values.get("id")
                self._line(values)
            except InputError as error:
                name = name if isinstance(name, str) and len(name) <= LONGEST_ID else None
                problem = " ".join(str(error).split())
                self._write({"answer": "error", "id": name, "line": number, "problem": problem}, always=False)
        if self._source.ended and not before:
            self._tell(f"the bridge has ended its lines: nothing more is heard of {self._robot}")

    def _line(self, values: dict[str, Any]) -> None:
        if "query" in values:
            if values != {"query": "hello"}:
                raise InputError('query: a bridge may ask {"query": "hello"}, for what it was told last')
            self._write({"answer": "ready", "protocol": PROTOCOL, "robot": self._robot, "units": self._units.names})
            self._write(self._command)
            return
        now = self._clock.now()
        report = read_report(values, self._robot, self._units, now, gated=self._gated)
        if isinstance(report, Fix) and report.time > now + _AHEAD:
            ahead = f"{report.time - now:.0f} s ahead of this computer's clock"
            raise InputError(f"time: {ahead}; leave it out, or set the clocks")
        name, line = values.get("id"), json.dumps(values, sort_keys=True)
        if name is not None and name in self._seen:
            known, answer = self._seen[name]
            if known != line:
                raise InputError(f"id: another line had the id {name!r:.60}; give each its own")
            again = self._command if isinstance(report, Reached) else answer
            if again is not None:
                self._write(again, always=False)
            return
        if name is not None:
            self._seen[name] = line, None
            while len(self._seen) > _REMEMBERED:
                self._seen.popitem(last=False)
        if isinstance(report, Fix) and (self._fix is None or report.time >= self._fix.time):
            self._fix = Fix(report.time, report.position, report.travelled)
            self._told.discard("position")
        if not isinstance(report, Reading | Reached | Wish):
            if name is not None:
                self._seen[name] = line, {"answer": "noted", "id": name}
                self._write({"answer": "noted", "id": name}, always=False)
            return
        report = self._named(report) if isinstance(report, Wish) else report
        self._unanswered[id(report)] = report, name
        while len(self._unanswered) > _REMEMBERED:
            self._unanswered.popitem(last=False)
        self._reports.append(report)

    def _named(self, report: Wish) -> Wish:
        """The wish with the log's name of a measurement that it calls by the bridge's."""
        known = self._seen.get(str(report.event.get("measurement")))
        if known is None or known[1] is None:
            return report
        return Wish(report.event | {"measurement": known[1].get("event", report.event["measurement"])})

    def _order(self, command: dict[str, Any]) -> None:
        """Tell the bridge what to do, as the answer to its arrival where that is what it waits for."""
        head = {"answer": command["answer"]} | ({} if self._asked is None else {"id": self._asked})
        self._command, self._asked = command, None
        self._write(head | command)

    def _write(self, answer: Mapping[str, Any], *, always: bool = True) -> None:
        if not self._sink.put(encode(dict(answer)), always=always):
            self._tell_once("full", "the bridge does not read its lines: acknowledgements are left out")
        if self._sink.problem is not None:
            self._tell_once("closed", f"the bridge hears nothing more of {self._robot}: {self._sink.problem}")

    def _tell_once(self, what: str, text: str) -> None:
        if what not in self._told:
            self._told.add(what)
            self._tell(text)
