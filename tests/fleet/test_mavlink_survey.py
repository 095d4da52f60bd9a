"""A whole survey of a robot with a scripted autopilot over a bad radio, from the first leg to the way home."""

import time
from typing import Any, cast

import numpy as np
import pytest

from maipp.fleet.hub import Faults, Hub
from maipp.fleet.logs import Logs
from maipp.fleet.mavlink import make, making
from maipp.fleet.member import Pace
from maipp.fleet.robot import Robot
from maipp.fleet.vehicles import VehicleContext
from maipp.live.team import TeamSurvey
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey
from tests.fleet.scripted_autopilot import METRE, Channel, Radio, ScriptedAutopilot

TICK = 0.05
HOME = np.array([10.0, 0.0])
MISSION = """
name: square
area: [[9.998, -0.002], [10.002, -0.002], [10.002, 0.002], [9.998, 0.002]]
no_go: [[[10.0004, 0.0004], [10.0010, 0.0004], [10.0010, 0.0010], [10.0004, 0.0010]]]
robots:
  - {name: boat-1, start: [10, 0], speed: 2, budget_m: 600, end: start}
measurement_spacing_m: 40
kernel: {length_scale_m: 100, mean: 10, std: 4}
noise: 0.4
planner: shared-greedy
vehicle: {kind: boat, autopilot: ardupilot}
scenario: {grid: 10, nodes: 40, neighbours: 6}
"""


@pytest.mark.parametrize("loss", [0.1])
def test_it_surveys_and_comes_home(tmp_path, monkeypatch, loss):
    mission = prepare(parse_survey(MISSION, source="mission.yaml"))
    survey = cast(TeamSurvey, TeamSurvey.from_prepared(mission, seed=5))
    radio, told = Radio(seed=2, loss=loss, double=0.1, delay=0.05), list[str]()
    pilot = ScriptedAutopilot(radio)
    pilot.nearby = 2.0  # metres from a waypoint at which it is there, as ArduPilot's WP_RADIUS
    pilot.value = lambda x, y: 10.0 + (x - 10.0) / METRE / 100.0
    track: list[tuple[float, float]] = []

    class Clock:
        def now(self):
            return radio.time

    def step(seconds=TICK):
        radio.time += TICK
        pilot.step(TICK)
        track.append((pilot.x, pilot.y))

    clock = Clock()
    monkeypatch.setattr(making, "MavlinkConnection", lambda url, baud, source, now: Channel(radio, clock, source))
    monkeypatch.setattr(time, "sleep", step)  # while it waits for the autopilot
    monkeypatch.setattr(time, "monotonic", lambda: radio.time)
    place = VehicleContext("boat-1", survey, mission, tmp_path, clock, 5, told.append)
    vehicle = make(place, {"sensor": "turbidity", "wait": "20"})
    vehicle._monotonic = clock.now
    told.clear()
    logs = Logs(tmp_path, "boat-1", survey.setup.digest(survey.world), tell=told.append)
    link, pace = Hub(Faults(), 0).link("boat-1"), Pace(contact=0.0)
    robot = Robot(survey, logs, link, vehicle, clock, pace=pace, tell=told.append)
    robot.begin()
    homes = 0
    while not robot.done and radio.time < 3000.0:
        step()
        before = robot.answer
        robot.work()
        homes += robot.answer is not before and robot.answer is not None and robot.answer["answer"] == "home"
    assert robot.done and homes == 1 and robot.answer is not None and robot.answer["reason"] == "home", told
    assert np.hypot(*(np.array([pilot.x, pilot.y]) - HOME)) / METRE < 10.0
    # 600 m of budget, a measurement every 40 m; legs end where the planner likes, so the last ones may be missing.
    samples: Any = survey._measurements.everything
    assert 9 <= len(samples) <= 15 and pilot.odometer < 610.0
    # It kept out of the zone, whatever got lost.
    x, y = ((np.array(track) - HOME) / METRE).T
    assert not ((x > 45) & (x < 111) & (y > 45) & (y < 111)).any()
    assert not any("not counted" in line or "not reported" in line for line in told), told
    vehicle.close()
    logs.close()
