"""The routes of a planned survey in the user's coordinates, as route files hold them."""

import math

import numpy as np
import shapely

from maipp.engine.episode import AgentRecord, Episode
from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.route_files.route_plan import Route, RoutePlan
from maipp.surveys.standardise import PreparedSurvey
from maipp.typing import Float

_SAME_PLACE = 0.01  # metres: vertices nearer to each other are one


def route_plan(prepared: PreparedSurvey, episode: Episode) -> RoutePlan:
    """What to load on the robots: the episode's routes, with the area and the zones.

    Raises `InputError` for a route that leaves the area, which a planner of the user's own may have made.
    """
    check_routes(prepared, episode)
    routes = []
    scenario = prepared.scenario
    every = scenario.ends_from(scenario.starts) if scenario.homes else ((),) * scenario.agents
    for robot, agent, ends in zip(prepared.survey.robots, episode.agents, every, strict=True):
        points, times = vertices(prepared, agent)
        measured = prepared.frame.to_user(agent.measurement_x)
        home = points[-1] if ends else None  # which is where the engine has it end
        routes.append(Route(robot.name, points, times, robot.speed, measured, home))
    return _plan(prepared, routes)


def check_files(prepared: PreparedSurvey) -> None:
    """Raise `InputError` for names and areas that route files cannot hold, before minutes of planning."""
    starts = prepared.frame.to_user(np.array(prepared.scenario.starts))
    try:
        _plan(
            prepared,
            [
                Route(robot.name, start[None], np.zeros(1), robot.speed)
                for robot, start in zip(prepared.survey.robots, starts, strict=True)
            ],
        )
    except InputError as error:
        raise InputError(f"{prepared.survey.source}: {error}") from None


def _plan(prepared: PreparedSurvey, routes: list[Route]) -> RoutePlan:
    return RoutePlan(
        title=prepared.survey.name,
        routes=tuple(routes),
        area=prepared.area,
        no_go=prepared.no_go,
        geographic=prepared.frame.geographic,
        quantity=prepared.survey.quantity,
        unit=prepared.survey.unit,
    )


def vertices(prepared: PreparedSurvey, agent: AgentRecord) -> tuple[Float[np.ndarray, "k 2"], Float[np.ndarray, " k"]]:
    """Where a robot turns, user coordinates, and when, seconds.

    A leg that is straight in local metres is curved in degrees. Whoever joins its ends by a line in degrees must not
    come out of the area: long legs get vertices in between, so that the two differ by a quarter of the margin at most.
    """
    frame = prepared.frame
    route, times = agent.route.astype(np.float64), agent.route_time.astype(np.float64) * prepared.seconds_per_time
    if frame.geographic and len(route) > 1:
        parts = [_pieces(frame, a, b, prepared.margin / 4) for a, b in zip(route[:-1], route[1:], strict=True)]
        shares = np.concatenate([i + np.arange(n) / n for i, n in enumerate(parts)] + [[len(parts)]])
        index = np.arange(len(route))
        route = np.stack([np.interp(shares, index, route[:, axis]) for axis in (0, 1)], axis=-1)
        times = np.interp(shares, index, times)
    # A place may be recorded twice in a row; no file has a leg of no length.
    apart = np.append(True, np.hypot(*np.diff(route, axis=0).T) * frame.scale > _SAME_PLACE)
    return frame.to_user(route[apart]), times[apart]


def _pieces(frame: GeoReference, start: Float[np.ndarray, "2"], end: Float[np.ndarray, "2"], most: float) -> int:
    """Into how many pieces to cut a leg so that no piece's line in degrees is more than `most` metres beside it."""
    ends = frame.to_user(np.stack([start, end]))
    if abs(ends[0, 0] - ends[1, 0]) > 180:
        return 1
    beside = frame.to_plane(ends.mean(axis=0)) - frame.domain_to_plane(np.stack([start, end]).mean(axis=0))
    # The deviation falls with the square of the length.
    return max(1, math.ceil(math.sqrt(float(np.linalg.norm(beside)) / max(most, 1e-3))))


def check_routes(prepared: PreparedSurvey, episode: Episode) -> None:
    """Raise `InputError` where a leg comes nearer to what it must keep out of than the margin allows."""
    frame = prepared.frame
    slack = max(prepared.margin / 2, 1e-5 * frame.scale)
    allowed = shapely.buffer(prepared.region, slack)
    shapely.prepare(allowed)
    for name, agent in zip(prepared.names, episode.agents, strict=True):
        places = frame.domain_to_plane(agent.route)
        if len(places) > 1 and not shapely.covers(allowed, shapely.linestrings(places)):
            where = prepared.survey.where("planner")
            raise InputError(f"{where}: {prepared.planner} led {name} out of the area; give another planner")


def minutes(prepared: PreparedSurvey, agent: AgentRecord) -> float:
    """How long a robot is under way, minutes."""
    return float(agent.route_time[-1]) * prepared.seconds_per_time / 60.0
