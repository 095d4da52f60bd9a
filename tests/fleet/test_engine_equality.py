"""A fleet of robots, each with a belief and a log of its own, decides what the engine decides, message for message.

The engine and the fleet go through one world side by side. Whoever is due decides in both; then its vehicle measures
and arrives exactly as the engine says, in the engine's arithmetic, so that nothing is rounded in two ways and all that
is between is compared to the bit: logs, their exchange, what is known of whom, and the decisions. The engine is keyed
as live surveys are: by robot and number of decision.
"""

import dataclasses
import heapq
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine.state import positions
from maipp.fleet.simulated import Simulated
from maipp.fleet.vehicle import Reached, Reading
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS, slow
from tests.shared.stepped import Stepped

SEED = 4
PLANNERS = ("ti", "intent-paths", "receding-horizon", "intent-search")
SCENARIO = Scenario(agents=3, budget=1.3, grid=8, nodes=16, neighbours=5)


class InTheEngine(Simulated):
    """A vehicle that does what an agent of the engine does."""

    _engine: Any = None
    _due: Any
    _taken = 0

    def travel(self, engine, agent):
        """Measure and arrive as the engine's agent will; it has just set off."""
        state = engine.state
        times = np.asarray(state.measurement_time[agent], np.float64)
        before, self._taken = self._taken, int(np.isfinite(times).sum())
        for slot in range(before, self._taken):
            place, value = (np.asarray(a[agent, slot]) for a in (state.measurement_x, state.measurement_y))
            heapq.heappush(self._due, (times[slot], next(self._number), (place.astype(float), float(value))))
        self._leg, self._engine, self._agent = np.asarray(state.leg[agent], np.float64), engine, agent
        self._arrives = float(state.odometer[agent])
        heapq.heappush(self._due, (float(state.arrival[agent]), next(self._number), None))

    def go(self, waypoints, measure, *, home=False):
        self._stay()
        self.told = waypoints, measure

    def _happen(self, until):
        """As its parent, but with the engine's places, values and odometer."""
        while self._due and self._due[0][0] <= until:
            time, _, what = heapq.heappop(self._due)
            if what is None:
                self._odometer = self._arrives
                self._place, self._leg, self._since = self._leg[-1], self._leg[-1:], time
                self._happened.append(Reached(**vars(self._fix(time, self._place, self._odometer))))
            else:
                self._happened.append(self.reading(time, *what))

    def where(self):
        """The engine works out where an agent is from the time; that may be an ulp short of its leg's end."""
        fix = super().where()
        if self._engine is None:
            return fix
        now = jnp.maximum(self._engine.state.time, fix.time)
        state = dataclasses.replace(self._engine.state, time=now)
        place = positions(state, self._engine.mission.params.speeds)[self._agent]
        return dataclasses.replace(fix, time=float(now), position=tuple(map(float, place)))

    def reading(self, time, place, value):
        return Reading(time, tuple(place.tolist()), None, value)


def side_by_side(make_team, scenario, planner, compare):
    """Run both, and compare every decision; how many there were."""
    slots = -(-5 * scenario.measurements_per_agent // 4)  # what a live survey has room for
    engine = Stepped(scenario, planner, slots, SEED)
    team = make_team(scenario, planner, SEED, whole=True, slots=slots)
    robots = []
    for number in range(scenario.agents):
        vehicle = team.vehicle(number, len, InTheEngine)
        robots.append(team.robot(number, vehicle, incarnation=f"{number:08x}"))
    if scenario.limited:
        places = {robot.name: robot.vehicle for robot in robots}

        def reach(one, other):
            gap = np.subtract(places[one].where().position, places[other].where().position)
            return bool(np.hypot(*gap) <= limit)

        limit, team.hub.reach = float(scenario.comm_range), reach
    count = 0

    def decided(robot):
        nonlocal count
        count += 1
        known = engine.known()
        agent = team.names.index(robot.name)
        assert int(known.agent) == agent
        made = engine.decide(known)
        compare(robot.survey.robot(robot.name), made)
        if made.go:
            robot.vehicle.travel(engine, agent)

    team.fleet(robots).run(decided)
    assert not engine.going
    return count, robots


def same(robot, made):
    """The leg, and to the bit the message and the memory."""
    # Legs of live surveys leave out waypoints where the robot is already, and are cut in double precision.
    moves = np.append(True, (np.abs(np.diff(made.leg, axis=0)) > 1e-5).any(axis=1))
    leg = made.leg[moves] if made.go else made.leg[:1]
    np.testing.assert_allclose(robot.leg, leg, atol=2e-6)
    if not made.go:  # who has nothing left is not asked what it would announce
        return
    for own, other in zip(*(jax.tree.leaves((each.message, each.memory)) for each in (robot, made)), strict=True):
        np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize(
    ("comm_range", "planner"),
    [
        (None, "intent-paths"),
        (0.3, "ti"),
        (0.3, "receding-horizon"),
        slow(None, "ti"),
        slow(None, "receding-horizon"),
        slow(None, "intent-search"),
        slow(0.3, "intent-paths"),
        slow(0.3, "intent-search"),
    ],
)
def test_three_robots_decide_what_the_engine_decides(make_team, comm_range, planner):
    scenario = SCENARIO.replace(comm_range=comm_range)
    count, robots = side_by_side(make_team, scenario, (planner, TINY_PLANNERS[planner]), same)
    assert count > 3 * scenario.agents
    if comm_range is None:
        heads = [robot.logs.heads() for robot in robots]
        # The last lines, of who stops last, nobody has asked for.
        assert max(sum(head.length for head in each.values()) for each in heads) > 3 * count // 2


@pytest.mark.slow
@pytest.mark.parametrize("planner", PLANNERS)
def test_ten_robots_decide_what_the_engine_decides(make_team, planner):
    scenario = SCENARIO.replace(agents=10, budget=0.5)
    count, _ = side_by_side(make_team, scenario, (planner, TINY_PLANNERS[planner]), same)
    assert count > 20


def test_a_robot_that_hears_nobody_decides_otherwise(make_team):
    """The check of the equality: of robots that do not hear each other, some decision is another one."""
    differ = []

    def differs(robot, made):
        differ.append(len(robot.leg) > 1 and made.go and not np.allclose(robot.leg[-1], made.leg[-1], atol=1e-4))

    class Deaf(make_team):
        def robot(self, *args, **more):
            robot = super().robot(*args, **more)
            self.hub.part([[name] for name in self.names])
            return robot

    side_by_side(Deaf, SCENARIO, ("receding-horizon", TINY_PLANNERS["receding-horizon"]), differs)
    assert any(differ)
