"""Every agent comes home: in time, around the zones, whatever its planner wants."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.engine import draw_missions, run_missions
from maipp.engine.decide import depart
from maipp.engine.decision import Decision
from maipp.engine.state import AT_HOME, BY_PLANNER, NOT_FINITE, REASONS, SPENT, TRAVELLING
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.problem import problem_of
from maipp.roadmap import Home, Obstacles, home_of
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS, some_planners

WALL = ((0.45, 0.25), (0.55, 0.25), (0.55, 1.0), (0.45, 1.0))
SCENARIO = Scenario(
    agents=2, budget=(2.0, 1.6), reserve=(0.2, 0.0), start=(0.2, 0.8), grid=8, nodes=24, neighbours=6, obstacles=(WALL,)
)
OF_HOME = home_of([[(0.2, 0.8)], [(0.2, 0.8)]], SCENARIO.obstacles, SCENARIO.extent, SCENARIO.grid)
HOME = Home(jax.tree.map(lambda array: array[0], OF_HOME.ends), OF_HOME.borders)
PROBLEM = problem_of(SCENARIO.replace(end="start"))
unit = st.floats(0, 1, width=32)


ENDS = ([[0.2, 0.8], [0.2, 0.7]], [[0.8, 0.8], [0.8, 0.9]], [[[0.8, 0.1], [0.1, 0.1]], []])  # of one shape


@some_planners("greedy", "lawnmower", "sga-rrt", "ti", "intent-search")
def test_everybody_comes_home_in_time_around_the_zones(name):
    """The start, another place behind a wall, and several for one agent while the other may end anywhere."""
    for end in ENDS:
        scenario = SCENARIO.replace(end=end)
        planner = make_planner(name, scenario, TINY_PLANNERS[name])
        check_homes(scenario, run_missions(planner, drawn(scenario, planner), jax.random.key(0)))


def test_a_home_at_the_edge_of_a_zone_is_reached_and_stayed_at():
    scenario = SCENARIO.replace(start=(0.449, 0.6), end="start")
    planner = make_planner("greedy", scenario)
    states = run_missions(planner, drawn(scenario, planner), jax.random.key(0))
    check_homes(scenario, states)


def test_the_start_may_be_drawn():
    scenario = SCENARIO.replace(end="start", start=None)
    planner = make_planner("greedy", scenario)
    missions = drawn(scenario, planner)
    states = run_missions(planner, missions, jax.random.key(0))
    np.testing.assert_allclose(states.leg[:, :, -1], missions.start, atol=1e-6)


def drawn(scenario, planner):
    return draw_missions(scenario, seed=3, instances=2, planner=planner)


def check_homes(scenario, states):
    last = np.asarray(states.leg[:, :, -1])
    odometer, obstacles = np.asarray(states.odometer), Obstacles(scenario.obstacles)
    assert (odometer <= np.array(scenario.budgets) - np.array(scenario.reserves) + 1e-5).all()
    assert (odometer > 0.5).all()
    for agent, places in enumerate(scenario.ends_from(scenario.starts)):
        for mission in range(2):
            count = int(states.route_length[mission, agent])
            route = np.asarray(states.route[mission, agent, :count], float)
            np.testing.assert_array_equal(route[-1], last[mission, agent])
            moved = np.hypot(*np.diff(route, axis=0).T) > 0
            assert not obstacles.crosses(route[:-1][moved], route[1:][moved]).any()
            if places:
                assert np.hypot(*(np.float32(places) - route[-1]).T).min() < 1e-6
                assert REASONS[states.stopped_by[mission, agent]] in ("home", "budget", "planner")


def decided(position, waypoints, remaining, homeward=False, stop=False):
    decision = Decision(jnp.asarray(waypoints, jnp.float32), (), (), jnp.asarray(stop))
    return depart_(jnp.asarray(position, jnp.float32), jnp.float32(remaining), decision, jnp.asarray(homeward))


depart_ = jax.jit(lambda *args: depart(PROBLEM, args[0], args[1], args[2], HOME, args[3], ()))


@given(unit, unit, unit, unit, st.floats(0.0, 2.0, width=32))
def test_a_leg_is_left_where_home_would_get_out_of_reach(x, y, u, v, remaining):
    if not Obstacles(SCENARIO.obstacles).free(np.array([[x, y], [u, v]])).all():
        return
    found = decided([x, y], [[u, v]], remaining)
    leg = np.asarray(found.leg, float)
    if found.homeward:
        assert np.hypot(*(leg[-1] - [0.2, 0.8])) < 1e-6 or int(found.stopped_by) == SPENT
    else:
        np.testing.assert_allclose(leg[-1], [u, v], atol=1e-6)
        back = decided(leg[-1], [leg[-1]], 2.0, stop=True)
        assert float(found.length + back.length) <= remaining + 1e-5
    straight = np.hypot(x - 0.2, y - 0.8)
    if float(decided([x, y], [[x, y]], 2.0, stop=True).length) <= remaining:  # home is in reach
        assert float(found.length) <= remaining + 1e-5
    assert float(found.length) >= straight * bool(found.homeward) - 1e-5


@pytest.mark.parametrize(
    ("waypoint", "stop"), [([0.8, 0.8], False), ([np.nan, 0.5], False), ([0.3, 0.8], True), ([0.3, 0.6], False)]
)
def test_whatever_a_planner_says_its_agent_does_not_stay_out(waypoint, stop):
    """A leg beyond reach, no number, an early stop, and a leg to where it is."""
    found = decided([0.3, 0.6], [waypoint], 0.3, stop=stop)
    assert found.go and found.homeward
    np.testing.assert_allclose(found.leg[-1], [0.2, 0.8], atol=1e-6)


def test_an_agent_that_is_homeward_goes_on_home_and_stops_there():
    found = decided([0.3, 0.6], [[0.3, 0.2]], 1.0, homeward=True)
    assert int(found.stopped_by) == TRAVELLING and found.homeward
    there = decided([0.2, 0.8], [[0.3, 0.2]], 0.5, homeward=True)
    assert int(there.stopped_by) == AT_HOME and float(there.length) == 0.0


@pytest.mark.parametrize(
    ("waypoint", "stop", "reason"),
    [([0.3, 0.8], True, BY_PLANNER), ([np.nan, 0.5], False, NOT_FINITE), ([0.2, 0.8], False, SPENT)],
)
def test_at_home_the_reason_to_stop_is_told(waypoint, stop, reason):
    assert int(decided([0.2, 0.8], [waypoint], 0.5, stop=stop).stopped_by) == reason


def test_a_home_out_of_reach_is_refused():
    with pytest.raises(InputError, match=r"end of agent 1: 1\.\d+ away from its start, of a budget of 1\.2"):
        draw_missions(SCENARIO.replace(budget=(2.0, 1.2), end=[[0.8, 0.8]]), seed=0, instances=1, roadmaps=False)
    closed = SCENARIO.replace(obstacles=(((0.45, -0.1), (0.55, -0.1), (0.55, 1.1), (0.45, 1.1)),), end=[[0.8, 0.8]])
    with pytest.raises(InputError, match="end of agent 0: no way there around the no-go zones"):
        draw_missions(closed, seed=0, instances=1, roadmaps=False)
