"""A survey that changes under way: zones, robots that join and leave, threshold and speeds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.live import LiveSurvey, worlds
from maipp.live.recorded_survey import read_record
from maipp.results.journals import taken_live
from maipp.roadmap import Obstacles
from maipp.scenario import Scenario
from tests.live.events import arrived, measured, text

HOMING = Scenario(agents=2, budget=1.2, start=(0.5, 0.5), end="start", reserve=0.1, grid=8, nodes=16, neighbours=5)


def square(x, y, side=0.1):
    """A square around a place."""
    return [[x + a * side / 2, y + b * side / 2] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def zone(name, polygon, time=0.0, key="z"):
    return {"event": "zone", "id": name, "name": key, "polygon": polygon, "time": time}


def threshold(name, value, time=0.0):
    return {"event": "threshold", "id": name, "threshold": value, "time": time}


def speed(name, value, time=0.0, robot="robot1"):
    return {"event": "speed", "id": name, "robot": robot, "speed": value, "time": time}


def joined(name, robot="late", position=(0.2, 0.2), time=0.2, **more):
    where = {"position": list(position), "time": time}
    return {"event": "joined", "id": name, "robot": robot, "budget": 1.0, "speed": 0.5} | where | more


def everything(survey):
    """All that a survey tells, every bit of it."""
    return text([survey.state(), survey.hello(), survey.belief()])


def test_a_zone_across_a_leg_has_the_robot_ask_again_and_keep_out(make, tmp_path):
    with make(tmp_path / "j") as survey:
        leg = survey.handle(arrived("a"))
        survey.handle(arrived("other", robot="robot2", time=0.0))
        middle = (np.array([0.5, 0.5]) + leg["waypoints"][0]) / 2
        polygon = square(*middle, side=0.06)
        answer = survey.handle(zone("z1", polygon, time=0.001))
        assert answer["answer"] == "noted" and "robot1" in answer["ask"] and "forgot" not in answer
        assert survey.state()["zones"] == survey.hello()["zones"] == [{"name": "z", "polygon": polygon}]
        closed, position, time = Obstacles([polygon]), [0.5, 0.5], 0.001
        for number in range(4):
            answer = survey.handle(arrived(f"b{number}", position=position, time=time))
            way = np.array([position, *answer["waypoints"]])
            assert answer["answer"] == "go" and not closed.crosses(way[:-1], way[1:]).any()
            position, time = answer["waypoints"][-1], answer["arrival"]
        assert not all(survey.belief()["inside"])
        told = everything(survey)
    with make(tmp_path / "j") as survey:
        assert everything(survey) == told
        assert survey.handle(zone("z1", polygon, time=0.001))["ask"]
        assert survey.handle(zone("z2", None, time=9.0)) == {"answer": "noted", "id": "z2", "known": True}
        assert "zones" not in survey.state() and all(survey.belief()["inside"])


def test_who_is_in_a_zone_goes_out_by_the_shortest_way(make):
    with make() as survey:
        survey.handle(arrived("a", position=(0.3, 0.3)))
        assert survey.handle(zone("z1", square(0.31, 0.3)))["ask"] == ["robot1"]
        answer = survey.handle(arrived("b", position=(0.3, 0.3), time=0.01))
        assert answer["waypoints"][0] == pytest.approx([0.26, 0.3], abs=4e-3)  # the clearance of planned ways


def test_roadmaps_begin_where_robots_are_if_a_zone_parts_them_from_their_start(make):
    with make() as survey:
        survey.handle(arrived("a", position=(0.5, 0.9)))
        survey.handle(zone("z1", [[-0.2, 0.65], [1.2, 0.65], [1.2, 0.7], [-0.2, 0.7]], time=0.001))
        north, south = np.asarray(survey.world.mission.roadmap.nodes)
        assert (north[:, 1] >= 0.7).all() and (south[:, 1] <= 0.65).all()
        answer = survey.handle(arrived("b", position=(0.5, 0.9), time=0.01))
        assert answer["answer"] == "go" and answer["waypoints"][-1][1] >= 0.7


@pytest.mark.parametrize(
    ("event", "told"),
    [
        (zone("x", [[0, 0], [1, 1], [1, 0], [0, 1]]), "polygon: not a simple polygon"),
        (zone("x", square(0.5, 0.5, 2.0)), "polygon: leaves nothing of the survey's area"),
        (zone("x", square(0.5, 5.0)), r"polygon\[0\]: .* is far outside of the survey's area"),
        (zone("x", square(-0.5, 0.5)), "polygon: lies outside of the survey's area"),
        (zone("x", [[0, 0], [0.1, 0.1], [0.2, 0.2]]), "polygon: its vertices lie on one line"),
        (zone("x", [[0, 0], [0.1, 0.1]]), "polygon: .* is not 3 to 400 positions"),
        (zone("x", square(0.5, 0.5), key=" "), "name: ' ' is not a name"),
        ({"event": "zone", "id": "x", "name": "z", "time": 0}, "polygon: missing; give 3 to 400 positions"),
        (threshold("x", 1e6), "threshold: 1e.06 lies more than 100 prior standard deviations"),
        (threshold("x", None), "threshold: missing"),
        (speed("x", 0.0), "speed: 0.0 is not a speed > 0"),
        (speed("x", 1e9), "speed: 1e.09 is no speed of a robot here"),
        (speed("x", 1.0, robot="late"), "robot: 'late' is not"),
        (joined("x", robot="robot2"), "robot: 'robot2' is in the team already"),
        (joined("x", position=(7, 7)), "position: .* is far outside"),
        (joined("x", end=[1.5, 0.5]), "end: lies outside of the survey's area"),
        (joined("x", end=[0.9, 0.9], budget=0.5), "end: farther than its budget; give an end that late can reach"),
        (joined("x", end="home"), "end: 'home' is not start"),
        (joined("x", budget=0.0), "budget: 0.0 is not a length > 0"),
        (measured("x", robot="late"), "robot: 'late' is not"),
    ],
)
def test_what_cannot_be_changed_is_told_and_nothing_is(make, tmp_path, event, told):
    with make(tmp_path / "j") as survey:
        before = text([survey.state(), survey.hello()]), (tmp_path / "j").read_bytes()
        with pytest.raises(InputError, match=f"^{told}") as error:
            survey.handle(event)
        assert "\n" not in str(error.value)
        assert (text([survey.state(), survey.hello()]), (tmp_path / "j").read_bytes()) == before


MOVED = [
    zone("z1", square(0.2, 0.2), 1.0),
    zone("z2", square(0.8, 0.2), 2.0),
    zone("z3", square(0.8, 0.8, 0.3), 1.5, key="y"),
    zone("z4", None, 3.0, key="x"),
    zone("z5", square(0.1, 0.5), 2.0, key="x"),
    threshold("t1", 0.7, 2.0),
    threshold("t2", 0.1, 1.0),
    speed("s1", 0.4, 2.0),
    speed("s2", 2.0, 1.0),
    measured("m1", (0.3, 0.4), 0.5, 0.7),
    measured("m2", (0.6, 0.4), 0.6, 0.9, robot="robot2"),
]


@given(order=st.permutations(MOVED), copies=st.lists(st.sampled_from(MOVED), max_size=4))
@settings(max_examples=6)
def test_the_later_time_counts_in_whatever_order(make, order, copies):
    with make() as calm, make() as disturbed:
        for event in MOVED:
            calm.handle(event)
        for event in [*order, *copies]:
            disturbed.handle(event)
        assert everything(disturbed) == everything(calm)
        state = calm.state()
        told = [("y", square(0.8, 0.8, 0.3)), ("z", square(0.8, 0.2))]
        assert state["zones"] == [{"name": name, "polygon": polygon} for name, polygon in told]
        assert state["threshold"] == 0.7 and [row["speed"] for row in state["robots"]] == [0.4, 1.0]
        assert calm.world.scenario.threshold == 0.7 and calm.world.mission.params.threshold == np.float32(0.7)


def test_decisions_are_those_of_a_survey_with_that_threshold_from_the_start(make, scenario, tmp_path):
    other = LiveSurvey.from_scenario(scenario.replace(threshold=-0.5), "shared-greedy")
    with make(tmp_path / "j") as survey, other, make() as plain:
        for one in (survey, plain, other):
            for index, place in enumerate([(0.3, 0.7), (0.7, 0.6), (0.4, 0.2)]):
                one.handle(measured(f"m{index}", place, 0.01 * index, -0.2))
        assert survey.handle(threshold("t", -0.5, 0.1)) == {"answer": "noted", "id": "t"}
        where = [(0.5, 0.5), (0.2, 0.3), (0.9, 0.8)]
        asked = [arrived(f"a{i}", position=place, time=0.2 + i, travelled=0.1) for i, place in enumerate(where)]
        mine, same, without = ([one.handle(event) for event in asked] for one in (survey, other, plain))
        assert text(mine) == text(same) != text(without)
        assert text(survey.belief()) == text(plain.belief())  # it says nothing of the field
        told = everything(survey)
    with make(tmp_path / "j") as survey:
        assert everything(survey) == told


def test_a_leg_is_planned_at_the_speed_told_last(make, tmp_path):
    with make(tmp_path / "j") as survey:
        assert survey.handle(speed("s", 0.25, 0.1)) == {"answer": "noted", "id": "s"}
        answer = survey.handle(arrived("a", time=0.2))
        way = np.linalg.norm(np.subtract(answer["waypoints"][0], (0.5, 0.5)))
        assert answer["arrival"] == pytest.approx(0.2 + way / 0.25, abs=1e-5)  # distances are float32
        told = everything(survey)
    with make(tmp_path / "j") as survey:
        assert everything(survey) == told


def test_a_robot_joins_takes_part_and_retires(make, tmp_path):
    with make(tmp_path / "j") as survey:
        survey.handle(measured("m0", (0.6, 0.6), 0.05, 0.3))
        survey.handle(arrived("a"))
        assert survey.handle(joined("j")) == {"answer": "noted", "id": "j"}
        late = survey.state()["robots"][2]
        assert (late["status"], late["position"], late["budget"], late["speed"]) == ("waiting", [0.2, 0.2], 1.0, 0.5)
        assert survey.hello()["robots"][2] == {"name": "late", "start": [0.2, 0.2], "budget": 1.0, "speed": 0.5}
        answer = survey.handle(arrived("b", robot="late", position=(0.2, 0.2), time=0.2))
        assert answer["answer"] == "go" and answer["remaining"] == 1.0
        told = everything(survey)
    with make(tmp_path / "j") as survey:
        assert everything(survey) == told
        assert survey.handle(joined("j")) == {"answer": "noted", "id": "j"}
        survey.handle(measured("m1", (0.25, 0.2), 0.3, 0.8, robot="late"))
        survey.handle({"event": "budget", "id": "more", "robot": "late", "budget": 2.0, "time": 0.3})
        survey.handle({"event": "gone", "id": "g", "robot": "late", "time": 0.4})
        state = survey.state()
        assert state["robots"][2]["status"] == "gone" and state["measurements"] == 2
        assert survey.belief([(0.25, 0.2)])["mean"] == pytest.approx([0.8], abs=1e-3)
        with pytest.raises(InputError, match="robot: 'late' is in the team already"):
            survey.handle(joined("again", time=0.5))
        told = everything(survey)
    with make(tmp_path / "j") as survey:
        assert everything(survey) == told


def test_worlds_between_are_not_drawn_again(make, tmp_path, monkeypatch):
    with make(tmp_path / "j") as survey:
        for index in range(3):
            survey.handle(zone(f"z{index}", square(0.2 + 0.2 * index, 0.2), float(index)))
        survey.handle(threshold("t", 0.2))
    drawn, draw = [], worlds.draw_world
    monkeypatch.setattr(worlds, "draw_world", lambda *each: drawn.append(each) or draw(*each))
    with make(tmp_path / "j") as survey:
        survey.state()
        assert not drawn
        for index in range(2):
            survey.handle(arrived(f"a{index}", position=(0.5, 0.5 + 0.1 * index), time=float(index)))
        assert len(drawn) == 1


def test_a_zone_that_cuts_a_robot_off_from_its_end_is_refused_unless_it_is_gone(tmp_path):
    wall = zone("wall", square(0.5, 0.5), 0.3)
    rest = [[-0.1, 0.25], [1.1, 0.25], [1.1, 1.1], [-0.1, 1.1]]
    with LiveSurvey.from_scenario(HOMING, "greedy", journal=tmp_path / "j") as survey:
        before = (tmp_path / "j").read_bytes()
        with pytest.raises(InputError, match="polygon: cuts robot1 off from its end; report it gone first"):
            survey.handle(wall)
        assert (tmp_path / "j").read_bytes() == before and "zones" not in survey.state()
        for robot in ("robot1", "robot2"):
            survey.handle({"event": "gone", "id": f"{robot}-gone", "robot": robot, "time": 0.2})
        survey.handle(joined("j", end=[[0.9, 0.9], [0.2, 0.3]]))
        assert survey.handle(wall) == {"answer": "noted", "id": "wall"}
        with pytest.raises(InputError, match="polygon: cuts late off"):
            survey.handle(zone("more", rest, 0.4))
        home = survey.world.mission.home
        assert home is not None and np.asarray(home.ends.bound).tolist() == [False, False, True]
        with pytest.raises(InputError, match="end: there is no way there around the no-go zones"):
            survey.handle(joined("k", "later", end=[0.5, 0.5]))
        # Back without its end, it keeps nobody from adding zones or robots.
        survey.handle(arrived("back", position=(0.3, 0.4), time=0.5))
        assert survey.handle(zone("far", square(0.8, 0.2), 0.6, key="y"))["answer"] == "noted"
        assert survey.handle(joined("l", "later", end="start"))["answer"] == "noted"
        state = text(survey.state())
    with LiveSurvey.from_scenario(HOMING, "greedy", journal=tmp_path / "j") as survey:
        assert text(survey.state()) == state


def test_a_way_home_that_a_zone_makes_too_long_is_told(tmp_path):
    """Ways of 0.7 and more around a wall, of a budget of 1.2 less 0.1, with 0.8 of it gone."""
    with LiveSurvey.from_scenario(HOMING, "greedy") as survey:
        survey.handle(arrived("a", position=(0.5, 0.8), travelled=0.7, time=1.0))
        answer = survey.handle(zone("z", [[0.1, 0.6], [0.9, 0.6], [0.9, 0.62], [0.1, 0.62]], 1.0))
        assert (answer["ask"], answer["short"]) == (["robot1"], ["robot1"])
        answer = survey.handle(zone("z2", [[0.45, 0.6], [0.55, 0.6], [0.55, 0.62], [0.45, 0.62]], 1.1))
        assert "short" not in answer


def test_the_result_of_a_changed_survey_is_of_what_it_became(make, tmp_path):
    """Read back without planner and mission: team, zones, threshold and belief are those of the survey at its end."""
    journal = tmp_path / "j"
    with make(journal, adapt=True) as survey:
        survey.handle(arrived("a0"))
        survey.handle(joined("j", position=[0.2, 0.2]))
        late = survey.state()["robots"][-1]["name"]
        survey.handle(zone("z", square(0.7, 0.2), 0.1))
        survey.handle(threshold("t", 0.2))
        for index in range(9):
            place = (0.1 + 0.06 * index, 0.3 + 0.04 * index)
            survey.handle(
                measured(f"m{index}", place, 0.2 + 0.01 * index, 0.3 * index, late if index % 2 else "robot2")
            )
        grid = survey.belief()
        record, episode = read_record(journal), taken_live(journal).episode
        assert record.names == tuple(robot["name"] for robot in survey.state()["robots"])
        assert record.place.scenario.obstacles == survey.world.scenario.obstacles
        assert record.place.scenario.threshold == 0.2 and record.place.site.no_go
        np.testing.assert_array_equal(np.asarray(record.mission.inside), grid["inside"])
    mean, std = record.belief(np.array(grid["points"]))
    np.testing.assert_allclose(mean, grid["mean"], atol=1e-6)  # digits of the answer
    np.testing.assert_allclose(std, grid["std"], atol=1e-6)
    assert len(episode.agents) == 3 and sum(len(agent.measurement_y) for agent in episode.agents) == 9
