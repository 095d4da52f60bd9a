"""`Watch`: one that only watches a fleet, and says how things stand, for a page to show."""

import hashlib
from collections.abc import Callable
from typing import Any

from maipp.errors import InputError
from maipp.fleet.chart import Chart, place_part
from maipp.fleet.clock import Clock
from maipp.fleet.fleet_status import FleetStatus
from maipp.fleet.log import Head, Origin
from maipp.fleet.logs import Logs
from maipp.fleet.maps import maps_part
from maipp.fleet.member import Member, Pace
from maipp.fleet.quiet import Quiet
from maipp.fleet.replica import Replica
from maipp.fleet.reports import Reports
from maipp.fleet.transport import Transport
from maipp.live.team import TeamSurvey

_MOST_REPLICAS = 4  # robots whose beliefs are kept at a time: each is a survey of its own


class Watch:
    """A read-only peer: it keeps all logs up to date, and decides nothing.

    Used from one thread, but for what it serves.
    """

    def __init__(
        self,
        survey: TeamSurvey,
        logs: Logs,
        transport: Transport,
        clock: Clock,
        *,
        monotonic: Callable[[], float] | None = None,
        pace: Pace | None = None,
        carries: bool = True,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        """`survey` is one that nothing was changed of yet; `monotonic` are the seconds that `pace` counts.

        One that `carries` brings the logs to whoever lacks them, as robots do. In a simulation that would join robots
        that do not hear each other.
        """
        self.survey, self.logs, self._clock, self._tell = survey, logs, clock, tell
        self._world, self._monotonic, chart = survey.world, monotonic or clock.now, Chart(survey.setup.units)
        self._place = place_part(survey, chart)
        self.reports, self._replicas = Reports(survey, chart), dict[str, Replica]()
        self.member = Member(
            survey,
            logs,
            transport if carries else Quiet(transport),
            changed=self.reports.take,
            monotonic=self._monotonic,
            pace=pace,
            tell=self._note,
        )
        self._standing = FleetStatus(self.member, self.reports, chart)
        self._state: dict[str, Any] = {}
        self._known: tuple[Any, ...] = ()

    def work(self) -> None:
        """Take in what has come, and ask for what is missing."""
        self.member.listen()
        self.member.keep_up()

    def snapshot(self) -> dict[str, Any]:
        """How things stand, ready for JSON; places are those of `Chart`, times seconds since the epoch.

        The parts: `place`, `changes` (zones added under way, threshold), `robots`, `kernel`, `kept_out` (row, why),
        `events`, `marks` (of beliefs: of all logs under "", else of the robot's), `now`, and `rows` (as `Row`), which
        only grow.
        """
        state, now = self._current_state(), self._clock.now() - self.survey.setup.units.epoch
        kept_out = self.reports.numbers(state.get("kept_out", []))
        zones = [
            {"name": zone["name"], "ring": self._standing.ring(zone["polygon"])} for zone in state.get("zones", [])
        ]
        return {
            "place": self._place,
            "changes": {"threshold": state["threshold"], "zones": zones},
            "robots": self._standing.robots(state["robots"], self._monotonic(), now),
            "kernel": state.get("kernel"),
            "kept_out": sorted(kept_out.items()),
            "events": self.reports.events(kept_out),
            "marks": {name: self.mark(name or None) for name in ("", *self.survey.names)},
            "now": {"time": round(now, 3), "measurements": state["measurements"]},
            "rows": [*self.reports.rows],
        }

    def mark(self, robot: str | None = None) -> str:
        """Says what a belief is made of: with the same mark it is the same."""
        ends = [f"{origin}:{head.length}" for origin, head in sorted(self._heads(robot).items()) if head.length > 1]
        return hashlib.sha256(" ".join(ends).encode("ascii")).hexdigest()[:16]

    def field(self, robot: str | None = None) -> dict[str, Any]:
        """Maps of the belief that all logs make up, or of that of one robot, as `maps_part`.

        A robot believes what it has told that its logs hold. Raises `InputError` for one that is not there.
        """
        if robot is None:
            return maps_part(self.survey.maps(), None, self.mark())
        if robot not in self.survey.names:
            raise InputError(f"robot: {robot!r:.60} is no robot of the survey; there is {', '.join(self.survey.names)}")
        replica = self._replicas.pop(robot, None) or Replica(self._world, self.survey.setup)
        self._replicas[robot] = replica
        while len(self._replicas) > _MOST_REPLICAS:
            del self._replicas[next(iter(self._replicas))]  # who was looked at longest ago
        mark = self.mark(robot)
        return maps_part(replica.follow(self.logs, self._heads(robot)).maps(), robot, mark)

    def close(self) -> None:
        """Let go of network and logs."""
        self.member.transport.close()
        self.logs.close()

    def _heads(self, robot: str | None) -> dict[Origin, Head]:
        """How far the logs go here, or as far as they are here with a robot."""
        if robot is None:
            return self.logs.heads()
        news = self.member.exchange.news.get(robot)
        heads = {} if news is None else news.heads
        lengths = {origin: min(head.length, self.logs.length(origin)) for origin, head in heads.items()}
        return {origin: Head(length, heads[origin].chain) for origin, length in lengths.items()}

    def _current_state(self) -> dict[str, Any]:
        """The survey's answer to a query for its state, asked again only where something has come."""
        known = (len(self.reports.rows), self.mark(), *map(self.survey.robot, self.survey.names))
        if len(known) != len(self._known) or any(
            one is not other and not (isinstance(one, int | str) and one == other)
            for one, other in zip(known, self._known, strict=True)
        ):
            self._state, self._known = self.survey.state(), known
        return self._state

    def _note(self, text: str) -> None:
        self.reports.tell(self._clock.now() - self.survey.setup.units.epoch, text)
        self._tell(text)
