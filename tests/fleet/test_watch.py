"""One that watches says what the robots say, and what each of them believes."""

import base64
import json

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fleet.chart import Chart
from maipp.fleet.frame import encode, encode_heads
from maipp.fleet.logs import Logs
from maipp.fleet.member import Pace
from maipp.fleet.watch import Watch
from maipp.geo import GeoReference
from maipp.live.events import Gone, Measurement, Threshold, Zone
from maipp.live.gate import LEVEL
from maipp.live.team import TeamSurvey
from maipp.live.units import Units
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS

SCENARIO = Scenario(agents=3, budget=1.2, start=(0.5, 0.5), end="start", grid=8, nodes=16, neighbours=5)
PLANNER = ("ti", TINY_PLANNERS["ti"])
PACE = Pace(beat=0.02, round=0.1, contact=0.1, silent=0.5)
SPIKE = 40.0


def field(points):
    return np.sin(7 * points[:, 0]) + points[:, 1]


@pytest.fixture(scope="module")
def make_watched(make_team):
    """A fleet that has surveyed for a while, and who watches it."""

    def make(until=0.5, scenario=SCENARIO, planner=PLANNER, **more):
        team = make_team(scenario, planner, gate=LEVEL, **more)
        robots = [team.robot(i, team.vehicle(i, field), pace=PACE) for i in range(scenario.agents)]
        fleet = team.fleet(robots, beat=PACE.beat)
        survey = TeamSurvey(team.world, team.setup)
        watch = Watch(survey, Logs(None, None, team.mission), team.hub.link("watch"), team.clock, pace=PACE)
        fleet.run(until=until)
        for robot in robots:
            robot.member.exchange.beat()
        watch.work()
        return team, robots, fleet, watch

    return make


def unpacked(told):
    """Numbers of a packed picture, rows going north."""
    numbers = np.frombuffer(base64.b64decode(told["numbers"]), "<u2").astype(float)
    return told["base"] + told["step"] * numbers


def check_field(told, survey):
    """Raise AssertionError where a field is not what a survey believes; a step is what packing rounds to."""
    belief = survey.belief()
    inside = np.array(belief["inside"]).reshape(8, 8).T.ravel()
    for name in ("mean", "std"):
        expected = np.array(belief[name]).reshape(8, 8).T.ravel()
        np.testing.assert_allclose(unpacked(told[name]), expected, atol=told[name]["step"])
    bits = np.unpackbits(np.frombuffer(base64.b64decode(told["inside"]), np.uint8), bitorder="little")
    np.testing.assert_array_equal(bits[:64], inside)
    scenario = survey.world.scenario
    bound = np.array(belief["mean"]) + scenario.beta * np.array(belief["std"])
    near = np.abs(bound - scenario.threshold).reshape(8, 8).T.ravel() < 1e-5
    high = (bound >= scenario.threshold).reshape(8, 8).T.ravel()
    assert ((unpacked(told["surplus"]) >= 0) == high)[~near].all()
    assert told["measurements"] == belief["measurements"]


def test_a_snapshot_says_what_the_robots_say(make_watched):
    team, robots, _, watch = make_watched()
    shot = json.loads(json.dumps(watch.snapshot(), allow_nan=False))
    assert shot["place"]["size"] == [1.0, 1.0] and shot["place"]["title"] == team.setup.site.title
    assert len(shot["place"]["starts"]) == len(shot["place"]["ends"]) == 3
    for robot, shown in zip(robots, shot["robots"], strict=True):
        own = robot.survey.state()["robots"][team.names.index(robot.name)]
        assert (shown["name"], shown["status"], shown["budget"]) == (robot.name, own["status"], own["budget"])
        assert shown["lines"] == robot.logs.length(robot.origin)
        assert shown["hears"] == [name for name in team.names if name != robot.name]
        assert not shown["silent"] and shown["heard"] == 0.0 and not shown["forked"]
        assert shown["plan"][-1] == pytest.approx(own["waypoints"][-1], abs=1e-5)
        assert shown["plan"][0] == shown["at"] == pytest.approx(robot.status()["position"], abs=1e-5)
        assert shown["left"] == pytest.approx(own["budget"] - shown["travelled"], abs=1e-3)
        # What it has travelled and its way home are within its budget: that is what it plans by.
        assert 0 < shown["home"]["length"] <= shown["left"] + 1e-3
        assert shown["home"]["way"][-1] == pytest.approx(shot["place"]["starts"][0])
        measured = [row for row in shot["rows"] if team.names[row[0]] == robot.name and row[4] is not None]
        assert len(measured) == shown["measurements"] > 0
    rows = [row for row in shot["rows"] if row[4] is not None]
    np.testing.assert_allclose([row[4] for row in rows], field(np.array([row[2:4] for row in rows])), atol=1e-4)
    assert shot["now"]["measurements"] == len(rows) and shot["kept_out"] == []
    assert [event["kind"] for event in shot["events"]].count("decision") == sum(row[4] is None for row in shot["rows"])
    assert [event["time"] for event in shot["events"]] == sorted(event["time"] for event in shot["events"])


def test_fields_are_what_all_and_what_each_robot_believe(make_watched):
    team, robots, fleet, watch = make_watched()
    pooled = watch.field()
    check_field(pooled, watch.survey)
    assert pooled["mark"] == watch.mark() and pooled["measurements"] == watch.snapshot()["now"]["measurements"]

    team.hub.part([["robot1", "watch"], ["robot2"], ["robot3"]])
    fleet.run(until=0.9)
    apart = [robot.survey.belief()["measurements"] for robot in robots]
    team.hub.heal()
    for robot in robots:  # each says how far it is; nobody fetches yet
        robot.member.exchange.beat()
    watch.work()
    team.clock.time = team.hub.time = team.clock.time + PACE.beat
    watch.work()
    marks = {robot.name: watch.mark(robot.name) for robot in robots}
    for robot, count in zip(robots, apart, strict=True):
        told = watch.field(robot.name)
        check_field(told, robot.survey)
        assert told["measurements"] == count < watch.survey.belief()["measurements"]
        assert told["robot"] == robot.name and told["mark"] == marks[robot.name]
    assert len({*marks.values(), watch.mark()}) == 4
    for robot in robots:
        robot.member.meet()
        robot.member.exchange.beat()
    watch.work()
    for robot in robots:  # the replicas go on from where they were
        check_field(watch.field(robot.name), robot.survey)
        assert watch.mark(robot.name) == watch.mark()
    with pytest.raises(InputError, match="'nobody' is no robot"):
        watch.field("nobody")


def test_a_robot_that_has_lost_what_it_carried_believes_less(make_watched):
    team, robots, _, watch = make_watched()
    watch.field("robot1")
    team.hub.part([["watch", "robot1"]])
    fresh = team.robot(0, robots[0].vehicle, pace=PACE, incarnation="000000ff")
    fresh.member.exchange.beat()
    watch.member.listen()
    assert watch.field("robot1")["measurements"] == 0 and watch.field()["measurements"] > 0


def test_changes_gated_values_and_silence_are_told(make_watched):
    team, robots, fleet, watch = make_watched(until=0.4)
    first, ring = robots[0], ((0.05, 0.05), (0.15, 0.05), (0.1, 0.2))
    now = team.clock.time
    first.survey.report(Zone("z", "Ferry", ring, now))
    first.survey.report(Threshold("t", 0.7, now))
    first.survey.report(Measurement("spike", "robot1", (0.5, 0.45), SPIKE, now))
    first.survey.report(Gone("g", "robot1", now))
    watch.work()
    shot = watch.snapshot()
    assert shot["changes"]["threshold"] == 0.7
    assert shot["changes"]["zones"] == [{"name": "Ferry", "ring": [pytest.approx(point) for point in ring]}]
    ((row, why),) = shot["kept_out"]
    assert shot["rows"][row][4] == SPIKE and why == "surprise"
    texts = {event["text"] for event in shot["events"] if event["kind"] in ("change", "gated")}
    assert {"no-go zone Ferry was added", "values from 0.7 on are of interest now"} <= texts
    assert "value 40 is not used: too far from what was expected there" in texts
    assert shot["robots"][0]["status"] == "gone"
    check_field(watch.field(), first.survey)
    team.hub.part([["watch"]])
    team.clock.time = team.hub.time = now + 1.0
    watch.work()
    shot = watch.snapshot()
    assert all(robot["silent"] for robot in shot["robots"])
    assert any("robot2 is silent" in event["text"] for event in shot["events"] if event["kind"] == "network")


@pytest.mark.parametrize("carries", [True, False])
def test_a_watcher_joins_robots_that_do_not_hear_each_other_only_if_it_is_to(make_watched, carries):
    team, robots, _, _ = make_watched(until=0.3, planner=("greedy", {}))
    link, survey = team.hub.link("shore"), TeamSurvey(team.world, team.setup)
    shore = Watch(survey, Logs(None, None, team.mission), link, team.clock, pace=PACE, carries=carries)
    team.hub.reach = lambda one, other: "shore" in (one, other)
    said = team.hub.sent
    robots[0].survey.report(Measurement("apart", "robot1", (0.5, 0.45), 0.9, team.clock.time))
    sent = team.hub.sent
    shore.work()
    shore.member.meet()
    origin = robots[0].origin
    whole = robots[0].logs.length(origin)
    assert shore.logs.length(origin) == whole
    robots[1].member.meet()
    robots[1].member.listen()
    assert (robots[1].logs.length(origin) == whole) == carries
    assert sent > said and (team.hub.sent > sent) == carries


STRANGE = [
    {"time": 10**400, "position": [0.5, 0.5]},
    {"time": 1e300, "position": [0.5, 0.5]},
    {"time": "now", "position": [0.5, 0.5]},
    {"time": 0.45, "position": [10**400, 0]},
    {"time": 0.45, "position": [[1], {}]},
    {"time": 0.45, "position": "ab", "hears": {"robot2": 1}},
    {"hears": [["robot2"], 3, None, "robot9"] * 1000, "time": None},
    {},
]


def test_what_a_robot_says_of_itself_is_believed_only_where_it_makes_sense(make_watched):
    _, robots, _, watch = make_watched(until=0.3, planner=("greedy", {}))
    before = watch.snapshot()["robots"][0]
    for status in STRANGE:
        frame = encode({"heads": encode_heads(robots[0].logs.heads()), "status": status})
        assert watch.member.exchange.hear_news("robot1", frame)
        after = watch.snapshot()["robots"][0]
        json.dumps(after, allow_nan=False)
        assert after["hears"] in ([], None)
        assert {**after, "hears": 0} == {**before, "hears": 0}


def test_intents_are_shown_as_they_were_announced(make_watched):
    team, robots, _, watch = make_watched(until=0.3)
    for robot, told in zip(robots, watch.snapshot()["robots"], strict=True):
        message = robot.survey.state()["robots"][team.names.index(robot.name)]["message"]
        assert told["intent"]["mean"] == pytest.approx(message["mean"], abs=1e-5)
        assert told["intent"]["covariance"] == pytest.approx(message["covariance"])


def test_robots_that_may_end_anywhere_have_no_way_home(make_watched):
    _, _, _, watch = make_watched(until=0.3, scenario=SCENARIO.replace(end=None), planner=("greedy", {}))
    shot = watch.snapshot()
    assert [robot["home"] for robot in shot["robots"]] == [None] * 3 and shot["place"]["ends"] == []


def test_the_chart_is_in_lengths_from_the_lower_left_corner():
    """Around 52 degrees of latitude: what is drawn is true to length, and bad positions are none."""
    frame = GeoReference.of_area((-500.0, -400.0, 500.0, 400.0), (4.74, 52.245)).standardised(9.0, 4.0)
    chart = Chart(Units(frame.domain, frame))
    middle = chart.place((4.74, 52.245))
    assert middle == pytest.approx([500.0, 400.0], abs=1e-4)
    # A minute of latitude is 1854.6 m there (WGS84 meridian arc), give or take the projection's scale.
    assert chart.place((4.74, 52.245 + 0.1 / 60)) == pytest.approx([500.0, 400.0 + 185.46], abs=0.1)
    np.testing.assert_allclose(chart.to_domain([500.0, 400.0]), [0.5, 0.4])
    for wrong in ((), (1.0,), ("a", "b"), None, (4.74, float("nan")), (0.0, 0.0), (4.74, 52.245, 1.0)):
        assert chart.place(wrong) is None
    assert chart.places([(4.74, 52.245), (0.0, 0.0)]) == [middle]
