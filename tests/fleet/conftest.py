"""Fleets in one process, of small surveys that share what is compiled."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from maipp.fleet.clock import VirtualClock
from maipp.fleet.hub import Faults, Hub
from maipp.fleet.logs import Logs
from maipp.fleet.member import Pace
from maipp.fleet.robot import Robot
from maipp.fleet.simulated import Simulated
from maipp.fleet.virtual import VirtualFleet, moment
from maipp.live.setups import scenario_setup
from maipp.live.team import TeamSurvey
from maipp.live.units import Units
from maipp.live.world import draw_world
from maipp.planners import make_planner

# Nobody is within reach but those that answer now, as in the engine.
NOW = Pace(contact=0.0)


class Whole(Units):
    """Units whose numbers are not rounded on the way out: a gradient planner carries one ulp far."""

    def points_out(self, points):
        return np.asarray(points, np.float64).tolist()

    def values_out(self, values):
        return np.asarray(values, np.float64).tolist()

    def length_out(self, length):
        return float(length)

    def time_out(self, time):
        return float(time)


class Team:
    """What the robots of a survey have in common, and a network for them."""

    def __init__(self, scenario, planner, seed=4, *, gate=0.0, adapt=False, faults=None, whole=False, slots=None):
        name, options = planner
        self.scenario = scenario
        self.world = draw_world(make_planner(name, scenario, options), scenario, seed)
        if slots is not None:  # of the same shape as another, so that both are compiled alike
            mission = self.world.mission
            shaped = replace(mission, shape=replace(mission.shape, slots=slots))
            self.world = replace(self.world, mission=shaped)
        setup = scenario_setup(scenario, name, options, seed, None, 0.0, gate, adapt, None, None)
        self.setup = replace(setup, units=Whole(scenario.extent)) if whole else setup
        self.mission = self.setup.digest(self.world)
        self.clock, self.hub = VirtualClock(), Hub(faults or Faults(), seed)
        self.names, self.starts = self.setup.robots, np.asarray(self.world.mission.start, np.float64)

    def vehicle(self, number, field, kind=Simulated, **given):
        """The simulated vehicle of one robot; `kind` is its class."""
        speeds, interval = self.scenario.speeds, self.scenario.measurement_interval
        more: dict[str, Any] = {"moment": moment(max(speeds))} | given
        return kind(self.setup.units, self.starts[number], speeds[number], interval, field, self.clock, **more)

    def robot(self, number, vehicle, folder=None, pace=NOW, tell=lambda text: None, incarnation=None):
        """One robot."""
        name = self.names[number]
        logs = Logs(folder, name, self.mission, incarnation=incarnation, tell=tell)
        survey = TeamSurvey(self.world, self.setup)
        return Robot(survey, logs, self.hub.link(name), vehicle, self.clock, pace=pace, tell=tell)

    def fleet(self, robots, beat=None):
        """All of them, on one clock."""
        for robot in robots:
            robot.begin()
        return VirtualFleet(robots, self.clock, self.hub, beat)


@pytest.fixture(scope="session")
def make_team():
    """The class of what robots have in common."""
    return Team
