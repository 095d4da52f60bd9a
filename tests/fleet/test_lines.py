"""The lines vehicle: what a bridge sends and is told, word for word."""

import re
from typing import Any

import pytest

from maipp.fleet.clock import VirtualClock
from maipp.fleet.lines import Lines, make
from maipp.fleet.vehicle import Answered, Fix, Reached, Reading, Vehicle, Wish
from maipp.live.request import LONGEST_LINE
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS
from tests.fleet.bridge import UNITS, Bridge, Sink, Source

SCENARIO = Scenario(agents=1, budget=1.3, start=(0.5, 0.5), grid=8, nodes=16, neighbours=5)


@pytest.fixture
def bridge():
    return Bridge()


def event(kind, **more):
    return {"event": kind} | more


def test_it_is_a_vehicle_that_begins_with_ready():
    sink: Any = Sink()
    source: Any = Source()
    vehicle = Lines("boat1", UNITS, VirtualClock(), lambda: Fix(0.0, (0.0, 0.0)), print, source, sink)
    assert isinstance(vehicle, Vehicle) and isinstance(vehicle, Answered)
    assert sink.lines == [
        {"answer": "ready", "protocol": "maipp.live/1", "robot": "boat1", "units": UNITS.names},
    ]


def test_orders_are_those_of_maipp_live(bridge):
    bridge.vehicle.go([(0.1, 0.2), (0.3, 0.4)], [(0.2, 0.3)])
    bridge.vehicle.hold()
    bridge.vehicle.hold()  # told once
    bridge.vehicle.go([(0.5, 0.5)], [], home=True)
    bridge.vehicle.close()
    assert bridge.heard() == [
        {"answer": "go", "waypoints": [[0.1, 0.2], [0.3, 0.4]], "measure": [[0.2, 0.3]]},
        {"answer": "stop", "reason": "hold"},
        {"answer": "home", "waypoints": [[0.5, 0.5]], "measure": []},
        {"answer": "stop", "reason": "hold"},
    ]
    assert bridge.sink.closed == 1


def test_reports_come_in_order_with_the_clock_s_time_where_none_is_told(bridge):
    bridge.send(event("measurement", position=[0.1, 0.2], value=3, time=5.5, travelled=0.25))
    bridge.send(event("measurement", position=[0.2, 0.2], value=-1.5, robot="boat1", id="m2"))
    bridge.send(event("budget", budget=0.8))
    bridge.send(event("zone", name="divers", polygon=[[0, 0], [0.2, 0], [0.2, 0.2]], time=6))
    bridge.send(event("zone", name="divers", polygon=None))
    bridge.send(event("threshold", threshold=0.7))
    bridge.send(event("speed", speed=2, travelled=None))
    bridge.send(event("arrived", position=[0.3, 0.2]))
    square = ((0.0, 0.0), (0.2, 0.0), (0.2, 0.2))
    reports = bridge.vehicle.poll()
    assert reports == [
        Reading(5.5, (0.1, 0.2), 0.25, 3.0),
        Reading(7.0, (0.2, 0.2), None, -1.5),
        Wish({"event": "budget", "budget": 0.8, "time": 7.0}),
        Wish({"event": "zone", "name": "divers", "polygon": [list(point) for point in square], "time": 6.0}),
        Wish({"event": "zone", "name": "divers", "polygon": None, "time": 7.0}),
        Wish({"event": "threshold", "threshold": 0.7, "time": 7.0}),
        Wish({"event": "speed", "speed": 2.0, "time": 7.0}),
        Reached(7.0, (0.3, 0.2)),
    ]
    assert bridge.vehicle.poll() == [] and bridge.heard() == [] and bridge.told == []


def test_where_it_is_follows_the_newest_line(bridge):
    assert bridge.vehicle.where() == Fix(7.0, (0.5, 0.5))  # the log's
    bridge.send(event("position", position=[0.4, 0.5], time=6.0, travelled=0.1))
    assert bridge.vehicle.where() == Fix(7.0, (0.4, 0.5), 0.1)
    bridge.send(event("position", position=[0.3, 0.5], time=5.0))  # late
    bridge.send(event("position", position=[0.35, 0.5], time=8.5, id="p1"))
    assert bridge.vehicle.where() == Fix(8.5, (0.35, 0.5))  # the bridge's clock is ahead
    assert bridge.vehicle.poll() == [] and bridge.heard() == [{"answer": "noted", "id": "p1"}]
    bridge.vehicle.go([(0.1, 0.1)], [])
    bridge.clock.time = 30.0
    bridge.vehicle.where()
    bridge.vehicle.where()
    assert bridge.told == ["no position of boat1 for 22 s; the bridge should send one every second"]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (b"", "an empty line"),
        (b"{", "not JSON|line"),
        (b"[1]", "mapping"),
        (b"\xff{}", "not UTF-8 text"),
        (b"x" * (LONGEST_LINE + 1), "longer than"),
        (b'{"event": "arrived", "event": "arrived"}', "twice|event"),
        ({}, "event: None; give arrived, measurement"),
        ({"event": 3}, "event: 3; give"),
        (event("joined", name="x"), "event: joined is for `maipp live`"),
        (event("gone"), "event: gone is for `maipp live`"),
        (event("arrived"), "position: missing"),
        (event("arrived", position=[0.5]), "position"),
        (event("arrived", position=[0.5, None]), "position"),
        (event("arrived", position=[50, 0.5]), "position: .* far outside"),
        (event("arrived", position=[0.5, 0.5], robot="boat2"), "robot.*boat1"),
        (event("arrived", position=[0.5, 0.5], time=-4), "time"),
        (event("arrived", position=[0.5, 0.5], time=90), "time: 83 s ahead of this computer's clock"),
        (event("position", position=[0.5, 0.5], value=3), "value"),
        (event("measurement", position=[0.5, 0.5]), "value: missing"),
        (event("measurement", position=[0.5, 0.5], value="3"), "value"),
        (event("measurement", position=[0.5, 0.5], value=1e300), "value"),
        (event("measurement", position=[0.5, 0.5], value=1, depth=3), "depth"),
        (event("zone", name="a", time=3), "polygon: missing"),
        (event("zone", name="a", polygon=[[0, 0], [0.2, 0]]), "polygon"),
        (event("threshold", threshold=1, robot="boat2"), "robot: 'boat2'; give boat1"),
        (event("speed", speed=0), "speed"),
        ({"query": "state"}, "query: a bridge may ask"),
        (event("arrived", position=[0.5, 0.5], id=3), "id"),
    ],
)
def test_a_wrong_line_is_answered_with_its_number_and_changes_nothing(bridge, line, problem):
    bridge.send(event("position", position=[0.1, 0.1]))
    bridge.send(line)
    assert bridge.vehicle.poll() == []
    (answer,) = bridge.heard()
    assert (answer["answer"], answer["id"], answer["line"]) == ("error", None, 2)

    assert re.search(problem, answer["problem"]) and "\n" not in answer["problem"]
    assert bridge.vehicle.where().position == (0.1, 0.1)


def test_values_of_any_size_pass_where_a_gate_judges_them():
    bridge = Bridge(gated=True)
    bridge.send(event("measurement", position=[0.5, 0.5], value=1e20))
    assert bridge.vehicle.poll() == [Reading(7.0, (0.5, 0.5), None, 1e20)]


def test_what_has_an_id_is_acknowledged_once_it_is_in_the_log_and_reported_once(bridge):
    line = event("measurement", position=[0.1, 0.1], value=2.0, id="m1")
    bridge.send(line)
    bridge.send(line)
    (reading,) = bridge.vehicle.poll()
    assert bridge.heard() == []  # not in the log yet
    bridge.vehicle.answered(reading, {"answer": "noted", "id": "boat1.0.4", "surprise": 0.5})
    noted = {"answer": "noted", "id": "m1", "event": "boat1.0.4", "surprise": 0.5}
    assert bridge.heard() == [noted]
    bridge.send({key: line[key] for key in reversed(line)})  # a bridge that restarted
    assert bridge.vehicle.poll() == [] and bridge.heard() == [noted]
    bridge.send(line | {"value": 3.0})
    assert bridge.vehicle.poll() == []
    (answer,) = bridge.heard()
    assert answer["id"] == "m1" and answer["problem"].startswith("id: another line had the id 'm1'")


def test_an_arrival_is_answered_with_where_to_go_also_when_it_is_sent_again(bridge):
    line = event("arrived", position=[0.1, 0.1], id="a1")
    bridge.send(line)
    (reached,) = bridge.vehicle.poll()
    bridge.vehicle.answered(reached, {"answer": "go", "id": "boat1.0.5"})
    bridge.vehicle.go([(0.2, 0.2)], [])
    go = {"answer": "go", "waypoints": [[0.2, 0.2]], "measure": []}
    assert bridge.heard() == [go | {"id": "a1"}]
    bridge.send(line)
    assert bridge.vehicle.poll() == [] and bridge.heard() == [go]
    bridge.send(event("arrived", position=[0.2, 0.2], id="a2"))
    (reached,) = bridge.vehicle.poll()
    bridge.vehicle.answered(reached, {"answer": "stop", "id": "boat1.0.6", "reason": "budget"})
    bridge.vehicle.hold()
    assert bridge.heard() == [{"answer": "stop", "id": "a2", "reason": "budget"}]
    bridge.send({"query": "hello"})
    bridge.vehicle.poll()
    ready, stop = bridge.heard()
    assert ready["answer"] == "ready" and stop == {"answer": "stop", "reason": "budget"}


def test_what_the_log_refuses_is_told(bridge):
    bridge.send(event("arrived", position=[0.1, 0.1], id="a1"))
    (reached,) = bridge.vehicle.poll()
    bridge.vehicle.answered(reached, {"answer": "error", "problem": "the survey is over"})
    assert bridge.heard() == [{"answer": "error", "id": "a1", "problem": "the survey is over"}]


def test_a_measurement_is_withdrawn_by_the_name_that_the_bridge_gave_it(bridge):
    bridge.send(event("measurement", position=[0.1, 0.1], value=2.0, id="m1"))
    (reading,) = bridge.vehicle.poll()
    bridge.vehicle.answered(reading, {"answer": "noted", "id": "boat1.0.4"})
    bridge.send(event("withdraw", measurement="m1"))
    bridge.send(event("keep", measurement="boat1.0.4"))
    withdraw, keep = bridge.vehicle.poll()
    assert withdraw == Wish({"event": "withdraw", "measurement": "boat1.0.4", "time": 7.0})
    assert keep == Wish({"event": "keep", "measurement": "boat1.0.4", "time": 7.0})


def test_the_end_of_the_lines_is_told_and_ends_nothing(bridge):
    bridge.send(event("measurement", position=[0.1, 0.1], value=2.0))
    assert len(bridge.vehicle.poll()) == 1
    bridge.source.ended = False
    real, bridge.source.take = bridge.source.take, lambda most: setattr(bridge.source, "ended", True) or []
    assert bridge.vehicle.poll() == [] and bridge.told == [
        "the bridge has ended its lines: nothing more is heard of boat1"
    ]
    bridge.source.take = real
    bridge.vehicle.go([(0.2, 0.2)], [])
    assert bridge.heard()[-1]["answer"] == "go" and len(bridge.told) == 1


def test_a_robot_is_driven_through_its_whole_survey(make_team):
    """With a bridge that does as it is told: all is acknowledged by the log's own ids, and it is home at the end."""
    team = make_team(SCENARIO, ("receding-horizon", TINY_PLANNERS["receding-horizon"]))
    bridge = Bridge()
    bridge.clock.time = 0.0
    bridge.vehicle._clock = team.clock
    robot = team.robot(0, bridge.vehicle)
    robot.begin()
    robot.work()
    bridge.send(event("position", position=team.starts[0].tolist()))
    measured, odometer, acknowledged = 0, 0.0, []
    while not robot.done:
        lines = bridge.heard()
        acknowledged += [line for line in lines if line["answer"] == "noted"]
        assert not any(line["answer"] == "error" for line in lines)
        order = [line for line in lines if line["answer"] in ("go", "stop")][-1]
        assert order["answer"] == "go"
        for place in order["measure"]:
            measured += 1
            bridge.send(event("measurement", id=f"m{measured}", position=place, value=0.5))
        team.clock.time += 0.1
        bridge.send(event("arrived", position=order["waypoints"][-1], id=f"a{odometer}"))
        odometer += 0.1
        robot.work()
    lines = bridge.heard()
    acknowledged += [line for line in lines if line["answer"] == "noted"]
    assert lines[-1]["answer"] == "stop" and lines[-1]["reason"] == "budget"
    assert measured > 3 and [line["id"] for line in acknowledged] == [f"m{i + 1}" for i in range(measured)]
    assert len({line["event"] for line in acknowledged}) == measured


def test_it_is_made_with_a_wait_for_the_first_position(make_team, tmp_path, monkeypatch):
    from maipp.errors import InputError
    from maipp.fleet import lines
    from maipp.fleet.vehicles import VehicleContext
    from maipp.live.team import TeamSurvey

    team = make_team(SCENARIO, ("receding-horizon", TINY_PLANNERS["receding-horizon"]))
    survey, told = TeamSurvey(team.world, team.setup), []
    place = VehicleContext(team.names[0], survey, None, tmp_path, team.clock, 0, told.append)
    source, sink = Source(), Sink()
    monkeypatch.setattr(lines, "LineInput", lambda: source)
    monkeypatch.setattr(lines, "LineOutput", lambda: sink)
    vehicle = make(place, {"wait": "0.3"})
    assert told == ["the bridge has not said where robot1 is in 0.3 s: taken to be where its log has it"]
    assert vehicle.where().position == pytest.approx((0.5, 0.5))
    source.waiting.append((1, b'{"event": "position", "position": [0.2, 0.3]}'))
    assert make(place, {}).where().position == (0.2, 0.3) and len(told) == 1
    for wrong in ("-1", "nan", "1e9"):
        with pytest.raises(InputError, match="--with wait="):
            make(place, {"wait": wrong})
