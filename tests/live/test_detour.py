"""Robots that are not where a planner thought are led out of no-go zones, and around them."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from maipp.engine.polyline import shortened
from maipp.live import LiveSurvey
from maipp.live.detour import keep_out, path_out
from maipp.roadmap import Obstacles
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS, some_planners

SQUARE = ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6))
ZONE = Scenario(obstacles=(SQUARE,))
ZONES = Obstacles((SQUARE,))
AXIS = st.floats(0, 1)


def test_a_free_leg_stays():
    leg = np.array([[0.1, 0.1], [0.3, 0.9], [0.9, 0.9]])
    assert keep_out(ZONE, leg) is leg
    across = np.array([[0.1, 0.5], [0.9, 0.5]])
    assert keep_out(Scenario(), across) is across


def test_a_leg_across_a_zone_goes_around_it_by_the_shortest_way():
    leg = np.array([[0.3, 0.5], [0.7, 0.5], [0.9, 0.9]])
    kept = keep_out(ZONE, leg)
    assert kept is not None and not ZONES.crosses(kept[:-1], kept[1:]).any()
    shortest = 2 * np.hypot(0.1, 0.1) + 0.2 + np.hypot(0.2, 0.4)
    assert np.hypot(*np.diff(kept, axis=0).T).sum() == pytest.approx(shortest, rel=0.01)


@given(x=AXIS, y=AXIS, to_x=AXIS, to_y=AXIS)
def test_no_leg_from_where_planners_may_begin_crosses_a_zone(x, y, to_x, to_y):
    place, end = np.array([x, y]), np.array([to_x, to_y])
    assume(ZONES.free(end[None])[0])
    begun = path_out(ZONE, place)
    assert ZONES.free(begun[None])[0]
    outside = max(min(x - 0.4, 0.6 - x, y - 0.4, 0.6 - y), 0.0)  # how deep in the zone it is
    assert np.hypot(*(begun - place)) == pytest.approx(outside, abs=3e-3)
    kept = keep_out(ZONE, np.stack([begun, end]))
    if kept is None:  # an end within the clearance of the zone
        assert not ZONES.free(end + 4e-3 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1.0]])).all()
        return
    np.testing.assert_array_equal(kept[[0, -1]], [begun, end])
    assert not ZONES.crosses(kept[:-1], kept[1:]).any()


@given(x=st.floats(-0.2, 1.2), y=st.floats(-0.2, 1.2))
def test_who_is_outside_of_the_domain_comes_back_the_shortest_way(x, y):
    place = np.array([x, y])
    np.testing.assert_array_equal(path_out(Scenario(), place), np.clip(place, 0, 1))


@some_planners("greedy", "lawnmower", "receding-horizon", "ti")
def test_a_robot_that_has_drifted_goes_out_by_the_shortest_way_with_every_planner(name):
    """Into a zone, and out of the domain; asked twice from one spot it is told the same."""
    scenario = Scenario(
        agents=1, budget=3.0, start=((0.1, 0.1),), grid=8, nodes=16, neighbours=5, obstacles=(SQUARE,), noise=1e-2
    )
    survey = LiveSurvey.from_scenario(scenario, name, TINY_PLANNERS[name])
    for number, (x, y, first) in enumerate([(0.42, 0.5, (0.4, 0.5)), (0.5, 0.59, (0.5, 0.6)), (1.02, 0.3, (1.0, 0.3))]):
        told = []
        for again in "ab":
            event = {"event": "arrived", "id": f"{number}{again}", "robot": "robot1", "position": [x, y]}
            told.append(survey.handle(event | {"time": number + 1.0, "travelled": 0.2 * number}))
        one, other = ({key: value for key, value in answer.items() if key != "id"} for answer in told)
        assert one == other and one["answer"] == "go"
        assert one["waypoints"][0] == pytest.approx(first, abs=4e-3)
        way = np.array(one["waypoints"])
        assert not ZONES.crosses(way[:-1], way[1:]).any() and (way >= 0).all() and (way <= 1).all()


@given(length=st.floats(0, 3))
def test_cut_to_a_length(length):
    line = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    kept = shortened(line, length)
    assert np.hypot(*np.diff(kept, axis=0).T).sum() == pytest.approx(min(length, 2.0))
    np.testing.assert_array_equal(kept[0], line[0])
