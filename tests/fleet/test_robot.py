"""One robot among others: what it does where its disk is full, others fall silent, zones come, or it starts again."""

import jax
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fleet.folder import mark_folder
from maipp.fleet.hub import Faults
from maipp.fleet.logs import DiskError
from maipp.fleet.member import Pace
from maipp.fleet.recorded_fleet import read_fleet_record
from maipp.fleet.vehicle import Wish
from maipp.live.gate import LEVEL
from maipp.results import read_taken
from maipp.scenario import Scenario
from tests.fleet.schedules import Scripted

SCENARIO = Scenario(agents=3, budget=1.6, start=(0.5, 0.5), grid=8, nodes=16, neighbours=5)
GREEDY = ("greedy", {})


def field(points):
    return np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])


def crew(make_team, folder=None, scenario=SCENARIO, **more):
    team = make_team(scenario, GREEDY, gate=LEVEL)
    robots = [
        team.robot(i, team.vehicle(i, field), None if folder is None else folder / str(i), **more)
        for i in range(scenario.agents)
    ]
    return team, robots


def scripted(make_team, number=0, folder=None, notes=None, **more):
    team = make_team(SCENARIO, GREEDY, gate=LEVEL)
    vehicle = Scripted(team.clock, tuple(team.starts[number].tolist()))
    return team, vehicle, team.robot(number, vehicle, folder, tell=(notes if notes is not None else []).append, **more)


def test_what_every_robot_takes_home_is_what_all_have_measured(make_team, tmp_path):
    team, robots = crew(make_team, tmp_path)
    team.fleet(robots).run()
    for robot in (*robots, *robots):
        robot.member.meet()
    for number, robot in enumerate(robots):
        mark_folder(tmp_path / str(number), robot.survey)
        robot.logs.close()
    own, beliefs = robots[0].survey.belief(), []
    for number in range(3):
        record = read_fleet_record(tmp_path / str(number))
        assert [robot.name for robot in record.robots] == list(team.names) and not record.torn
        assert len(record.reports) == len(own_reports(robots))
        beliefs.append(record.belief(np.asarray(team.world.mission.grid, np.float64)))
        taken = read_taken(tmp_path / str(number))
        assert taken.live and len(taken.samples) == len(record.reports)
    for mean, std in beliefs:
        np.testing.assert_array_equal(mean, beliefs[0][0])
        np.testing.assert_allclose(team.setup.units.values_out(mean), own["mean"])
        np.testing.assert_allclose(team.setup.units.std_out(std), own["std"])


def own_reports(robots):
    return [report for report, _, _ in robots[0].survey._measurements.everything]


def test_a_result_names_a_damaged_log(make_team, tmp_path):
    team, _, robot = scripted(make_team, folder=tmp_path)
    robot.vehicle.measures(1.0)
    robot.measure()
    mark_folder(tmp_path, robot.survey)
    robot.logs.close()
    path = tmp_path / f"{robot.origin}.log"
    path.write_bytes(path.read_bytes().replace(b'"value":1.0', b'"value":2.0'))
    with pytest.raises(InputError, match=r"line 1 is damaged.*take the folder of another robot"):
        read_fleet_record(tmp_path)


def test_with_a_full_disk_it_holds_and_drops_nothing(make_team, monkeypatch):
    notes = []
    team, vehicle, robot = scripted(make_team, notes=notes)
    append, full = robot.logs.append, [True]

    def refuse(record):
        if full:
            raise DiskError("No space left on device")
        return append(record)

    robot.logs.append = refuse
    robot.begin()
    robot.decide()
    assert robot.asks and not vehicle.ahead
    vehicle.measures(0.5)
    for _ in range(3):
        robot.work()
    assert sum("holding" in note for note in notes) == 1  # told once
    full.clear()
    for _ in range(2):
        team.clock.time += 2.0
        robot.work()
    assert vehicle.ahead and robot.logs.length(robot.origin) == 3 and len(robot.survey._measurements) == 1


def test_who_is_not_heard_is_told_once_and_not_counted_on(make_team):
    notes, pace = [], Pace(beat=1.0, round=5.0, contact=3.0, silent=30.0)
    team, vehicle, robot = scripted(make_team, notes=notes, pace=pace)
    other = team.robot(1, Scripted(team.clock, (0.5, 0.5)), pace=pace)
    robot.begin()
    other.begin()
    for each in (robot, other):
        each.work()
    assert robot.survey.within_reach == {"robot2"} and not robot.member.silent
    team.hub.part([["robot1"], ["robot2"]])
    for second in range(60):
        team.clock.time = team.hub.time = float(second)
        robot.work()
    vehicle.arrives()
    robot.work()
    assert robot.survey.within_reach == frozenset()
    assert robot.member.silent == {"robot2", "robot3"}
    assert sum("robot2 is silent" in note for note in notes) == 1
    team.hub.heal()
    team.clock.time = team.hub.time = 61.0
    other.work()
    robot.work()
    assert "robot2 is heard again" in notes and robot.member.silent == {"robot3"}


def test_an_intent_is_counted_on_until_the_log_says_more(make_team):
    team = make_team(SCENARIO, ("sga-rrt", {"nodes": 8, "lengths": (0.2, 0.3)}), gate=LEVEL)
    one, other = (team.robot(i, Scripted(team.clock, (0.5, 0.5))) for i in range(2))
    team.hub.faults = Faults()
    one.begin()
    other.begin()
    lost, one.member.exchange.announce = one.member.exchange.announce, lambda part: None  # only the intent arrives
    one.decide()
    other.member.listen()
    own, heard = one.survey.robot("robot1"), other.survey.robot("robot1")
    for mine, theirs in zip(*(jax.tree.leaves(each.message) for each in (own, heard)), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert len(heard.leg) == 1 and len(own.leg) > 1
    one.member.exchange.announce = lost
    other.member.meet()
    np.testing.assert_array_equal(other.survey.robot("robot1").leg, own.leg)


def test_a_zone_that_somebody_adds_makes_all_ask_again(make_team):
    team, vehicle, robot = scripted(make_team)
    other_vehicle = Scripted(team.clock, (0.5, 0.5))
    other = team.robot(1, other_vehicle)
    for each in (robot, other):
        each.begin()
        each.decide()
    ring = [[0.6, 0.6], [0.9, 0.6], [0.9, 0.9]]
    vehicle.reports.append(Wish({"event": "zone", "name": "wreck", "polygon": ring}))
    robot.measure()
    assert robot.asks
    other.member.listen()
    assert other.asks and other.survey.hello()["zones"][0]["name"] == "wreck"
    other.decide()
    assert not other.asks


def test_a_robot_writes_of_itself_only(make_team):
    notes = []
    team, _, robot = scripted(make_team, notes=notes)
    other = team.robot(1, Scripted(team.clock, (0.5, 0.5)))
    other.vehicle.measures(1.0)
    other.measure()
    (origin, record), *_ = other.logs.records()
    another = {"event": record["event"] | {"robot": "robot3", "id": "another"}, "answer": record["answer"]}
    other.logs.append(another)
    robot.member.meet()
    assert len(robot.survey._measurements) == 1
    assert any("an event of robot3 in the log of robot2" in note for note in notes)


def test_started_again_it_is_done_or_asks_from_where_it_is(make_team, tmp_path):
    team, robots = crew(make_team, tmp_path)
    fleet = team.fleet(robots)
    fleet.run(until=0.8)
    robots[0].logs.close()
    again = team.robot(0, robots[0].vehicle, tmp_path / "0")
    again.begin()
    assert again.asks and len(again.survey._answers) == len(robots[0].survey._answers)
    before = again.survey.robot("robot1").odometer
    again.decide()
    assert again.survey.robot("robot1").odometer >= before and again.origin != robots[0].origin
    fleet.robots = [again, *robots[1:]]
    fleet.run()
    assert all(robot.done for robot in fleet.robots)
    assert again.survey.robot("robot1").odometer <= 1.6 + 1e-6
    again.logs.close()
    last = team.robot(0, robots[0].vehicle, tmp_path / "0")
    last.begin()
    assert last.done and not last.asks


def test_a_robot_that_joins_is_heard_once_its_joining_is(make_team):
    team, vehicle, robot = scripted(make_team)
    other = team.robot(1, Scripted(team.clock, (0.5, 0.5)))
    robot.begin()
    robot.decide()
    joined = {"event": "joined", "robot": "extra", "position": [0.2, 0.2], "budget": 1.0, "speed": 1.0}
    vehicle.reports.append(Wish(joined))
    robot.measure()
    assert "extra" in robot.survey.names
    other.member.meet()
    assert "extra" in other.survey.names


def test_where_there_is_no_fix_it_holds_and_asks_again(make_team):
    notes = []
    team, vehicle, robot = scripted(make_team, notes=notes)
    robot.begin()
    place, vehicle.place = vehicle.place, (float("nan"), 0.5)
    for _ in range(5):
        team.clock.time += 0.5
        robot.work()
    assert not vehicle.ahead and sum("holding, since this is no arrival" in note for note in notes) == 1
    vehicle.place = place
    team.clock.time += 2.0
    robot.work()
    assert vehicle.ahead
