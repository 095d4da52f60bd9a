"""Small live surveys that share what is compiled."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maipp.live import LiveSurvey
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=2, budget=1.2, start=(0.5, 0.5), grid=8, nodes=16, neighbours=5)


def value_at(point: list[float]) -> float:
    """What is measured somewhere."""
    return float(np.sin(4 * point[0]) * np.cos(3 * point[1]))


def follow(handle: Callable[[dict[str, Any]], dict[str, Any]], robots: dict[str, list[float]]) -> list[dict[str, Any]]:
    """The events, in order of time, of robots that do exactly as they are told until they stop."""
    events: list[dict[str, Any]] = []
    pending = [(0.0, 1, name, start) for name, start in robots.items()]  # 0 measures, 1 arrives
    while pending:
        pending.sort(key=lambda one: (round(one[0], 5), one[1], one[2]))
        time, arrives, name, point = pending.pop(0)
        event = {"event": "arrived" if arrives else "measurement", "id": f"e{len(events)}", "robot": name}
        event |= {"position": point, "time": time} | ({} if arrives else {"value": value_at(point)})
        events.append(event)
        answer = handle(event)
        if answer["answer"] != "go":
            continue
        pending.append((answer["arrival"], 1, name, answer["waypoints"][-1]))
        for place in answer["measure"]:
            path = np.array([point, *answer["waypoints"]])
            # Planners on a roadmap go straight.
            share = np.hypot(*(np.array(place) - path[0])) / max(np.hypot(*(path[-1] - path[0])), 1e-9)
            pending.append((time + min(float(share), 1.0) * (answer["arrival"] - time), 0, name, place))
    return events


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """The small scenario."""
    return SCENARIO


@pytest.fixture(scope="session")
def measure() -> Callable[[list[float]], float]:
    """What is measured somewhere."""
    return value_at


@pytest.fixture(scope="session")
def team() -> Callable[..., list[dict[str, Any]]]:
    """Robots that do exactly as they are told."""
    return follow


@pytest.fixture(scope="session")
def make() -> Callable[..., LiveSurvey]:
    """Makes a live survey of the small scenario."""

    def make_survey(journal: Path | None = None, **changes: Any) -> LiveSurvey:
        planner = changes.pop("planner", "shared-greedy")
        return LiveSurvey.from_scenario(SCENARIO, planner, journal=journal, **changes)

    return make_survey


@pytest.fixture(scope="session")
def events(make) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The events of a whole survey in order, and their answers."""
    answers: list[dict[str, Any]] = []
    with make() as survey:

        def handle(event: dict[str, Any]) -> dict[str, Any]:
            answers.append(survey.handle(event))
            return answers[-1]

        start = [0.5, 0.5]
        return follow(handle, {name: start for name in survey.setup.robots}), answers
