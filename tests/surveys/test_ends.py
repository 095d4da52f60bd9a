"""Robots of a mission file come home: what the file may say, and what is refused."""

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.surveys.expected_mission import expected_course
from maipp.surveys.routes import route_plan
from tests.surveys.conftest import SQUARE, prepared_from

ONE = "- {name: one, start: [0, 0], speed: 2, budget_m: 1500}"
TWO = "- {name: two, start: [50, 50], speed: 1, budget_minutes: 20}"


def square_with(one="", two="", more=""):
    text = SQUARE.replace(ONE, ONE.replace("}", f"{one}}}")).replace(TWO, TWO.replace("}", f"{two}}}"))
    return text + more


def test_ends_and_reserves_in_the_scenario():
    prepared = prepared_from(square_with(", end: [[900, 100], [0, 900]], reserve: 20 %", ", reserve_minutes: 5"))
    scenario, scale = prepared.scenario, prepared.frame.scale
    ends = np.array(scenario.ends_from(scenario.starts)[0]) * scale
    np.testing.assert_allclose(ends, [[900, 100], [0, 900]], atol=3)  # moved off the border
    assert scenario.ends_from(scenario.starts)[1] == ()
    np.testing.assert_allclose(np.array(scenario.reserves) * scale, [300, 300])


def test_routes_end_at_home_within_the_budget():
    prepared = prepared_from(square_with(", end: start, reserve_m: 100", ", end: [900, 400]"))
    episode = expected_course(prepared).episode
    (one, two), scale = route_plan(prepared, episode).routes, prepared.frame.scale
    assert np.hypot(*(one.points[-1] - one.points[0])) < 0.01
    assert np.hypot(*(two.points[-1] - [900, 400])) < 3
    distances = [agent.distance * scale for agent in episode.agents]
    assert distances[0] <= 1400.01 and distances[1] <= 1200.01


def test_return_home_is_short_for_end_start():
    prepared = prepared_from(square_with(", end: [500, 900]", more="vehicle: {kind: boat, return_home: true}\n"))
    scenario = prepared.scenario
    assert scenario.starts is not None
    assert scenario.ends_from(scenario.starts)[1] == (scenario.starts[1],)
    end = np.array(scenario.ends_from(scenario.starts)[0]) * prepared.frame.scale
    np.testing.assert_allclose(end, [[500, 900]], atol=1)


@pytest.mark.parametrize(
    ("one", "problem"),
    [
        (", end: home", r"mission.yaml:7: robots\[0\].end: 'home' .*give start, \[x, y\], or a list of such"),
        (", reserve: 2", r"robots\[0\].reserve: 2 .*a share of the budget from 0 to 0.95, such as 0.2 or 20 %"),
        (", reserve: 20 km", r"robots\[0\].reserve: '20 km' .*a share of the budget"),
        (", reserve: 0.1, reserve_m: 100", r"robots\[0\]: give one of reserve and reserve_m"),
        (", reserve_m: 1500", r"robots\[0\].reserve_m: 1500 m is not below the budget, 1500 m"),
        (", reserve_m: 1400", r"robots\[0\].budget_m: 1500 allows 100 m, less than measurement_spacing_m"),
        (", end: [650, 650]", r"robots\[0\].end: \(650.0, 650.0\) lies .* outside the area"),
        (", end: [900, 900], reserve_m: 500", r"robots\[0\].end: one ends 1\d\d\d m away by the shortest way, and may"),
    ],
)
def test_what_cannot_be_is_told_with_its_line(one, problem):
    with pytest.raises(InputError, match=problem):
        prepared_from(square_with(one))
