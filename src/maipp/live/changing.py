"""What a change of the survey does: whom it concerns, and what is refused."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.engine.homing import full_path_home
from maipp.errors import InputError
from maipp.live.carried import carried
from maipp.live.changes import Changes, Joiner, Ring, ThresholdSetting, ZoneSetting
from maipp.live.events import Change, Joined, Threshold, Zone
from maipp.live.robot_state import GONE, STOPPED, TRAVELLING, WAITING, RobotState
from maipp.live.survey_limits import open_places, own_parts
from maipp.live.worlds import Worlds
from maipp.roadmap import Home, Obstacles, free_space
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Float

# As in mission files.
_MOST_ROBOTS = 100


class Changed(NamedTuple):
    """What an event changes of the survey as a whole."""

    changes: Changes
    robots: list[RobotState]
    forgot: list[str]  # of the robots: "messages", "memories"


def changed(
    event: Change,
    inner: dict[str, Any],
    state: dict[str, Any] | None,
    changes: Changes,
    robots: Sequence[RobotState],
    worlds: Worlds,
) -> Changed:
    """What an answered event changes, live and from the journal, of whose answer `state` is a part. Draws nothing."""
    after = proposed(event, inner, changes)
    if state is None:
        return Changed(after, [*robots], [])
    after = replace(after, anchors=tuple((float(x), float(y)) for x, y in state["anchors"]))
    count = len(robots) + isinstance(event, Joined)
    before, now = worlds.nothing(len(robots)), worlds.nothing(count)
    team, forgot = carried(robots, before, now, (len(robots), count), worlds.base.planner.memory_of_place)
    if isinstance(event, Joined):
        time, leg = inner["time"], np.array([inner["position"]])
        told = {"leg": leg, "latest": time, "time": time, "fixes": [(time, 0.0)]}
        team.append(RobotState(event.robot, inner["speed"], inner["budget"], *now, **told))
    return Changed(after, team, forgot)


def consider(
    event: Change, inner: dict[str, Any], changes: Changes, robots: Sequence[RobotState], worlds: Worlds
) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The answer to a change, and what it needs to be taken over; draws the world that it leads to.

    Raises `InputError` for a change that leaves no room for the survey, and for a robot that cannot join.
    """
    answer: dict[str, Any] = {"answer": "noted", "id": event.id}
    if isinstance(event, Threshold):
        return answer, None
    if isinstance(event, Joined):
        _check_joining(event, inner, robots, worlds.base.scenario.extent)
    elif event.polygon is None:
        answer["known"] = changes.zone(event.name) is not None
    after = proposed(event, inner, changes)
    if after.rings == changes.rings and after.joined == changes.joined:
        return answer, None
    key = "position" if isinstance(event, Joined) else "polygon"
    try:
        state = {"anchors": [list(anchor) for anchor in _anchors(inner, after, robots, worlds)]}
        taken = changed(event, inner, state, changes, robots, worlds)
        world = worlds.of(taken.changes)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None
    if not np.asarray(world.mission.inside).any():
        raise InputError(f"{key}: leaves no point of the evaluation grid free; give a smaller zone")
    _check_ends(event, changes, taken, worlds, inner["time"])
    if isinstance(event, Zone):
        answer |= _concerned(event, inner, taken, worlds)
    return answer | ({"forgot": taken.forgot} if taken.forgot else {}), state


def proposed(event: Change, inner: dict[str, Any], changes: Changes) -> Changes:
    """The changes with this one; roadmaps begin where they did."""
    if isinstance(event, Threshold):
        return changes.with_threshold(ThresholdSetting(inner["time"], event.id, inner["threshold"], event.threshold))
    if isinstance(event, Joined):
        x, y = inner["position"].tolist()
        joiner = Joiner(event.robot, (x, y), inner["budget"], inner["speed"], inner["ends"], inner["time"])
        return changes.with_robot(joiner)
    return changes.with_zone(event.name, ZoneSetting(inner["time"], event.id, inner["ring"], event.polygon))


def _check_joining(
    event: Joined, inner: dict[str, Any], robots: Sequence[RobotState], extent: tuple[float, float]
) -> None:
    """Raise `InputError` for a robot that is there already, one too many, or one that ends outside of the area."""
    if any(robot.name == event.robot for robot in robots):
        raise InputError(
            f"robot: {event.robot!r} is in the team already; one that was gone is back when it reports arrived"
        )
    if len(robots) >= _MOST_ROBOTS:
        raise InputError(f"robot: the team has {_MOST_ROBOTS} robots already, the most there may be")
    if any(not (0 <= x <= extent[0] and 0 <= y <= extent[1]) for x, y in inner["ends"]):
        raise InputError("end: lies outside of the survey's area; give a place in it")


def _anchors(
    inner: dict[str, Any], after: Changes, robots: Sequence[RobotState], worlds: Worlds
) -> tuple[tuple[float, float], ...]:
    """Where roadmaps begin from now on."""
    starts = np.array(worlds.starts(after))
    time = inner["time"]
    places = [
        start if robot.status == WAITING else robot.where(max(time, robot.time))
        for robot, start in zip(robots, starts, strict=False)
    ]
    places += [*starts[len(robots) :]]
    return own_parts(worlds.obstacles(after), worlds.base.scenario.extent, starts, np.array(places))


def _check_ends(event: Joined | Zone, changes: Changes, taken: Changed, worlds: Worlds, time: float) -> None:
    """Raise `InputError` for a robot of the team that has an end and no way there any more."""
    extent = worlds.base.scenario.extent
    before, after = worlds.obstacles(changes), worlds.obstacles(taken.changes)
    for robot, ends in zip(taken.robots, worlds.ends(taken.changes), strict=True):
        new = isinstance(event, Joined) and robot.name == event.robot
        if not ends or robot.status == GONE or not (new or isinstance(event, Zone)):
            continue
        here = robot.where(max(time, robot.time))
        length = _length_to(after, extent, here, ends)
        if new and length > robot.budget:
            problem = "there is no way there around the no-go zones" if np.isinf(length) else "farther than its budget"
            raise InputError(f"end: {problem}; give an end that {robot.name} can reach")
        if np.isinf(length) and np.isfinite(_length_to(before, extent, here, ends)):
            raise InputError(
                f"polygon: cuts {robot.name} off from its end; report it gone first, or give a zone that leaves a way"
            )


def _length_to(
    obstacles: tuple[Ring, ...], extent: tuple[float, float], here: Float[np.ndarray, "2"], ends: Ring
) -> float:
    """Length of the shortest way from a place to the nearest of some ends, domain units; inf: there is none."""
    if not obstacles:
        return min(float(np.hypot(*(here - np.array(end)))) for end in ends)
    free = free_space(obstacles, extent)
    (begin,) = own_parts(obstacles, extent, here[None], here[None])
    lengths = [free.length_between(np.array(begin), np.array(end)) for end in open_places(obstacles, extent, ends)]
    return min(lengths, default=np.inf)


def _concerned(event: Zone, inner: dict[str, Any], taken: Changed, worlds: Worlds) -> dict[str, Any]:
    """Who has to ask again: robots in the new zone, and those whose leg enters it or is too long now for the way home.

    `ask` are their names, `short` those that cannot get home on their budget any more.
    """
    world, ask, short = worlds.of(taken.changes), [], []
    if inner["ring"] is None:
        return {}
    new = Obstacles(worlds.grown(inner["ring"]))
    for agent, robot in enumerate(taken.robots):
        if robot.status not in (TRAVELLING, STOPPED):
            continue
        time = max(inner["time"], robot.time)
        travels = robot.status == TRAVELLING
        ahead = robot.ahead(time) if travels else robot.position[None]
        if not new.free(ahead[:1])[0] or (len(ahead) > 1 and new.crosses(ahead[:-1], ahead[1:]).any()):
            ask.append(robot.name)
        home = world.mission.home
        if home is None or not travels or not np.asarray(home.ends.bound)[agent]:
            continue
        own = Home(jax.tree.map(lambda array, i=agent: array[i], home.ends), home.borders)
        left = robot.budget - world.scenario.reserves[agent] - robot.odometer - robot.covered(time)
        rest = float(np.hypot(*np.diff(ahead, axis=0).T).sum())
        late = not robot.homeward and rest + full_path_home(own, ahead[-1])[1] > left + DISTANCE_TOLERANCE
        if late and robot.name not in ask:
            ask.append(robot.name)
        (begin,) = own_parts(world.scenario.obstacles, world.scenario.extent, ahead[:1], ahead[:1])
        if full_path_home(own, np.array(begin))[1] > left + DISTANCE_TOLERANCE:
            short.append(robot.name)
    return ({"ask": ask} if ask else {}) | ({"short": short} if short else {})
