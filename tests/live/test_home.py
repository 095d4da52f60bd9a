"""Robots of a live survey are told to go home in time."""

import numpy as np
import pytest

from maipp.live import LiveSurvey
from maipp.scenario import Scenario
from tests.live.events import arrived, text

SCENARIO = Scenario(agents=2, budget=1.2, start=(0.5, 0.5), end="start", reserve=0.1, grid=8, nodes=16, neighbours=5)


def length(*points):
    return np.hypot(*np.diff(np.array(points, float), axis=0).T).sum()


def test_a_robot_is_sent_home_before_its_reserve_and_stops_there(tmp_path):
    with LiveSurvey.from_scenario(SCENARIO, "greedy", journal=tmp_path / "j") as survey:
        position, time, answers = [0.5, 0.5], 0.0, []
        for number in range(40):
            answers.append(survey.handle(arrived(f"a{number}", position=position, time=time)))
            if answers[-1]["answer"] == "stop":
                break
            position, time = answers[-1]["waypoints"][-1], answers[-1]["arrival"]
        kinds = [answer["answer"] for answer in answers]
        assert kinds[0] == "go" and kinds[-2:] == ["home", "stop"] and answers[-1]["reason"] == "home"
        assert position == pytest.approx([0.5, 0.5], abs=1e-6)
        assert answers[-1]["travelled"] <= 1.1 + 1e-5
        state = text(survey.state())
    with LiveSurvey.from_scenario(SCENARIO, "greedy", journal=tmp_path / "j") as again:
        assert text(again.state()) == state


def test_a_budget_that_is_cut_under_way_sends_it_home_at_once_if_it_must(tmp_path):
    budget = {"event": "budget", "robot": "robot1", "time": 0.05}
    with LiveSurvey.from_scenario(SCENARIO, "greedy", journal=tmp_path / "j") as survey:
        leg = survey.handle(arrived("a"))
        assert survey.handle(budget | {"id": "more", "budget": 1.1})["answer"] == "noted"
        away = length([0.5, 0.5], *leg["waypoints"])
        cut = survey.handle(budget | {"id": "cut", "budget": 0.1 + 1.5 * away, "time": 0.06})
        assert cut["answer"] == "home" and cut["waypoints"][-1] == pytest.approx([0.5, 0.5], abs=1e-6)
        assert cut["travelled"] == pytest.approx(0.06, abs=1e-6)
        assert survey.handle(arrived("b", position=[0.5, 0.5], time=0.2))["reason"] == "home"
        state = text(survey.state())
    with LiveSurvey.from_scenario(SCENARIO, "greedy", journal=tmp_path / "j") as again:
        assert text(again.state()) == state


@pytest.mark.parametrize(("off", "answer"), [(0.009, "stop"), (0.011, "home")])
def test_who_comes_home_as_nearly_as_vehicles_do_is_there(off, answer):
    """Within a twentieth of the measurement interval of 0.2; else a boat a metre off would go home for ever."""
    with LiveSurvey.from_scenario(SCENARIO, "greedy") as survey:
        leg = survey.handle(arrived("a"))
        away = length([0.5, 0.5], *leg["waypoints"])
        budget = {"event": "budget", "robot": "robot1", "time": 0.05, "id": "cut", "budget": 0.1 + 1.5 * away}
        assert survey.handle(budget)["answer"] == "home"
        told = survey.handle(arrived("b", position=[0.5, 0.5 + off], time=0.2))
        assert told["answer"] == answer and told.get("reason", "home") == "home"
