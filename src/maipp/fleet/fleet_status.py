"""How each robot of a fleet stands, as far as one that watches can tell."""

import math
from typing import Any

import jax
import numpy as np

from maipp.engine.homing import full_path_home
from maipp.fleet.chart import Chart, Pair
from maipp.fleet.event_text import STOPS
from maipp.fleet.member import Member
from maipp.fleet.reports import Reports
from maipp.live.detour import path_out
from maipp.live.robot_state import STOPPED, TRAVELLING
from maipp.live.team import TeamSurvey
from maipp.live.world import World
from maipp.roadmap import Home


class FleetStatus:
    """Puts together what logs, the network, and the robots themselves say."""

    def __init__(self, member: Member, reports: Reports, chart: Chart) -> None:
        self._member, self._reports, self._chart = member, reports, chart
        self._ways: dict[str, tuple[World, Pair, dict[str, Any]]] = {}  # of each robot, from where, and its way home

    @property
    def _survey(self) -> TeamSurvey:
        return self._member.survey

    def ring(self, polygon: list[list[float]]) -> list[Pair]:
        """The places around a polygon of the caller's."""
        return self._chart.places(polygon)

    def robots(self, states: list[dict[str, Any]], monotonic: float, now: float) -> list[dict[str, Any]]:
        """All of the team; `states` are those of the survey's answer, `now` is seconds since the epoch."""
        return [self._robot(number, state, monotonic, now) for number, state in enumerate(states)]

    def _robot(self, number: int, state: dict[str, Any], monotonic: float, now: float) -> dict[str, Any]:
        name, units, news = state["name"], self._survey.setup.units, self._member.exchange.news
        robot, told = self._survey.robot(name), news[name].status if name in news else {}
        heard = self._member.heard.get(name)
        time, place, travelled = self._whereabouts(name, state, told)
        if travelled is None:
            travelled = units.length_out(robot.odometer + robot.covered(time / units.seconds_per_time))
        left = max(state["budget"] - travelled, 0.0)
        answer = robot.answer or {}
        return {
            "name": name,
            "status": state["status"],
            "why": STOPS.get(answer.get("reason", ""), "") if state["status"] == STOPPED else "",
            "homeward": robot.homeward and state["status"] == TRAVELLING,
            "heard": None if heard is None else round(monotonic - heard, 1),
            "silent": name in self._member.silent,
            "forked": any(origin.robot == name for origin in self._member.logs.forked),
            "time": time,
            "at": place,
            "position": units.points_out(self._chart.to_domain(place)[None])[0],
            "plan": self._plan(state, place, time),
            "intent": self._intent(state["message"]),
            "budget": state["budget"],
            "travelled": round(travelled, 4),
            "left": round(left, 4),
            "home": self._home(number, name, place),
            "hears": _names(told.get("hears"), self._survey.names),
            "lines": sum(head.length for origin, head in self._member.logs.heads().items() if origin.robot == name),
            "measurements": self._reports.measured.get(name, 0),
        }

    def _whereabouts(self, name: str, state: dict[str, Any], told: dict[str, Any]) -> tuple[float, Pair, float | None]:
        """When and where it was last, by whatever says so last, and its way until then where that is told."""
        epoch = self._survey.setup.units.epoch
        known = (round(state["time"] - epoch, 3), self._chart.place(state["position"]) or [0.0, 0.0], None)
        reports = [known, self._reports.latest.get(name, known)]
        place = self._chart.place(told.get("position"))
        if place is not None and (time := self._time(told.get("time"))) is not None:
            reports.append((round(time - epoch, 3), place, None))
        # Of several at one time the one that knows the way travelled.
        return max(reports, key=lambda report: (report[0], report[2] is not None))

    def _time(self, told: Any) -> float | None:
        """The caller's time that a robot said; None for what is none of this survey."""
        try:
            self._survey.setup.units.time("time", float(told))
            return float(told)
        except (TypeError, ValueError, OverflowError):  # InputError is a ValueError
            return None

    def _plan(self, state: dict[str, Any], place: Pair, time: float) -> list[Pair]:
        """What is left of its leg, from where it was last."""
        if state["status"] != TRAVELLING:
            return []
        robot, per_time = self._survey.robot(state["name"]), self._survey.setup.units.seconds_per_time
        ahead = robot.ahead(max(time / per_time, robot.time))[1:]
        return [place, *self._chart.of_domain(ahead)] if len(ahead) else []

    def _intent(self, message: dict[str, Any] | None) -> dict[str, Any] | None:
        """What it means to do: an ellipse by mean and covariance, or places."""
        if message is None:
            return None
        if "mean" in message:
            mean = self._chart.place(message["mean"])
            return None if mean is None else {"mean": mean, "covariance": self._chart.covariance(message["covariance"])}
        places = self._chart.places(message.get("points", []))
        return {"places": places} if places else None

    def _home(self, number: int, name: str, place: Pair) -> dict[str, Any] | None:
        """The shortest way to where it is to end; None where it may end anywhere. Without a way no length."""
        world = self._survey.world
        home = world.mission.home
        if home is None or not np.asarray(home.ends.bound)[number]:
            return None
        known = self._ways.get(name)
        if known is None or known[0] is not world or known[1] != place:
            own = Home(jax.tree.map(lambda array: array[number], home.ends), home.borders)
            way, length = full_path_home(own, path_out(world.scenario, self._chart.to_domain(place)))
            length = self._survey.setup.units.length_out(length) if math.isfinite(length) else None
            known = self._ways[name] = world, place, {"length": length, "way": self._chart.of_domain(way)}
        return known[2]


def _names(told: Any, names: tuple[str, ...]) -> list[str] | None:
    """Robots of the team that somebody named; None where nothing was said."""
    return [name for name in names if name in told] if isinstance(told, list) else None
