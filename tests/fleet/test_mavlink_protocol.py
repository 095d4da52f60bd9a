"""The MAVLink vehicle against a scripted autopilot, over a radio that loses, doubles and delays."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.fleet.mavlink import drive
from maipp.fleet.mavlink.autopilot import Autopilot
from maipp.fleet.mavlink.course import AutopilotSettings, Notices
from maipp.fleet.mavlink.drive import Drive, LocalPlane, Senses
from maipp.fleet.mavlink.inside import Inside
from maipp.fleet.mavlink.mission_items import fence_items
from maipp.fleet.mavlink.modes import ARDUPILOT, PX4, modes_of
from maipp.fleet.mavlink.sensor import Sensor
from maipp.fleet.vehicle import Reached, Reading, Vehicle
from maipp.route_files.fences import Fence
from maipp.route_files.vehicle_settings import VehicleSettings as Kind
from tests.fleet.scripted_autopilot import METRE, Channel, Radio, ScriptedAutopilot

AREA = np.array([[9.99, -0.01], [10.01, -0.01], [10.01, 0.01], [9.99, 0.01]])
ZONE = np.array([[10.002, 0.002], [10.003, 0.002], [10.003, 0.003], [10.002, 0.003]])
TICK = 0.05  # s; a radio's delay is of that size


def to_plane(points):
    """Metres around 10 E, 0 N."""
    return (np.asarray(points, float) - (10.0, 0.0)) / METRE


def to_user(points):
    return np.asarray(points, float) * METRE + (10.0, 0.0)


def degrees(*points):
    return [tuple(point) for point in to_user(points).tolist()]


class World:
    """A vehicle, its autopilot, and the radio between them."""

    def __init__(self, kind=ARDUPILOT, margin=1.0, fence=(), **radio):
        self.radio, self.told = Radio(**radio), []
        boat = Kind("boat", "px4" if kind == PX4 else "ardupilot")
        self.modes = modes_of(kind, "boat")
        modes = {"mode": self.modes.hold.custom, "auto": self.modes.mission.custom}
        self.pilot = ScriptedAutopilot(self.radio, kind, **modes)
        self.pilot.value = lambda x, y: float(to_plane([(x, y)])[0, 0])  # metres east
        self.channel = Channel(self.radio, self)
        inside = Inside(Fence(AREA, (ZONE,)), margin, to_plane)
        ground = LocalPlane(to_plane, to_user, inside, 20.0, 5.0)
        autopilot = Autopilot(0, 245, self.channel.send)
        choice, senses = AutopilotSettings(boat, lambda: 2.0, "", fence), Senses(Sensor(2.0), "turbidity")
        said = Notices("boat", self.told.append)
        self.vehicle = Drive(self.channel, autopilot, ground, choice, senses, self, said, lambda: self.radio.time)
        self.run(3.0 if not radio.get("loss") else 10.0)
        assert self.vehicle.known

    def now(self):
        """The survey's time."""
        return 1000.0 + self.radio.time

    def run(self, seconds, until=lambda reports: False) -> list[Any]:
        """That long, or until what is reported is enough."""
        reports, end = [], self.radio.time + seconds
        while self.radio.time < end and not until(reports):
            self.radio.time += TICK
            self.pilot.step(TICK)
            reports += self.vehicle.poll()
        return reports

    def arrive(self, seconds) -> list[Any]:
        """Until it reports that it is there, which it must."""
        reports = self.run(seconds, lambda reports: any(isinstance(report, Reached) for report in reports))
        assert reports and isinstance(reports[-1], Reached), (self.vehicle.course.state, self.told)
        return reports

    def started_right(self, waypoints):
        """Whether it was told to go with all of this mission, from its begin, each time."""
        first = 1 if self.pilot.kind == ARDUPILOT else 0
        for mission, current in self.pilot.starts:
            places = [(item.y / 1e7, item.x / 1e7) for item in mission if item.command == 16][first:]
            assert places == [pytest.approx(point, abs=1e-7) for point in waypoints]
            assert mission[first].command == 178 and mission[first].param2 == 2.0
            assert current in (first, first + 1)
        assert self.pilot.starts
        self.pilot.starts = []


WAY = degrees((30.0, 0.0), (30.0, 40.0))
PLACES = degrees((20.0, 0.0), (30.0, 10.0), (30.0, 30.0))


@pytest.mark.parametrize("kind", [ARDUPILOT, PX4])
def test_it_goes_along_its_way_measures_and_arrives(kind):
    world = World(kind)
    assert isinstance(world.vehicle, Vehicle)
    assert world.vehicle.where().position == pytest.approx((10.0, 0.0), abs=1e-7)
    world.vehicle.go(WAY, PLACES)
    *readings, reached = world.arrive(60.0)
    world.started_right(WAY)
    assert reached.position == pytest.approx(WAY[-1], abs=0.4 * METRE)
    assert len(readings) == 3 and all(isinstance(reading, Reading) for reading in readings)
    for reading, place in zip(readings, PLACES, strict=True):
        # 5 positions a second at 2 m/s, values twice a second: within 0.4 m, and 1 m of way for the value.
        gap = to_plane([reading.position])[0] - to_plane([place])[0]
        assert math.hypot(*gap) < 0.4
        assert reading.value == pytest.approx(to_plane([place])[0, 0], abs=1.4)
    times = [report.time for report in [*readings, reached]]
    # 20, 40 and 60 m at 2 m/s, and 70 m at the end.
    assert np.diff(times) == pytest.approx([10.0, 10.0, 5.0], abs=0.3)
    assert world.told == []
    world.run(3.0)
    assert world.pilot.mode == world.modes.hold.custom  # it stays there
    assert "mission_clear_all" not in world.channel.names


def test_heartbeats_and_streams_are_asked_for():
    world = World()
    asked = ["command_long", "command_long"]
    assert world.channel.names == asked  # positions come from then on
    world.pilot.silent = {"global_position_int"}
    world.run(7.0)
    assert world.channel.names == 3 * asked
    assert world.told == ["boat: the autopilot does not say where it is"]
    world.pilot.silent = set()
    world.run(1.0)
    assert world.told[-1] == "boat: the autopilot says again where it is"


@settings(max_examples=12, deadline=None)
@given(
    st.integers(0, 10**6),
    st.sampled_from([ARDUPILOT, PX4]),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.sampled_from([0.0, 0.3]),
    st.sampled_from([0.02, 0.4]),
)
def test_nothing_that_the_radio_does_leads_it_astray(seed, kind, loss, double, delay):
    """Four ways, one of which is given up half way: it goes exactly these, from their begin, and arrives."""
    world = World(kind, seed=seed, loss=loss, double=double, delay=delay)
    ways = [WAY, degrees((0.0, 40.0)), degrees((0.0, 0.0), (-30.0, 0.0), (0.0, 0.0)), degrees((20.0, 20.0))]
    for number, way in enumerate(ways):
        world.vehicle.go(way, [])
        if number == 2:
            world.run(200.0, lambda reports: world.pilot.odometer > 130)
            world.vehicle.hold()
            world.run(30.0, lambda reports: world.pilot.mode == world.modes.hold.custom)
            assert world.pilot.mode == world.modes.hold.custom
            assert world.run(5.0) == []  # old messages that it has arrived are of no account
        else:
            # At 30 % loss a command takes a few seconds; an upload some 20.
            reached = world.arrive(400.0)[-1]
            # Of five positions a second ten in a row may get lost: 4 m.
            assert to_plane([reached.position])[0] == pytest.approx(to_plane(way[-1:])[0], abs=4.0)
            at = to_plane([(world.pilot.x, world.pilot.y)])[0]
            assert at == pytest.approx(to_plane(way[-1:])[0], abs=0.1)
        world.started_right(way)


@pytest.mark.parametrize("seed", range(3))
def test_places_are_measured_once_each_with_loss(seed):
    world = World(seed=seed, loss=0.2, double=0.2, delay=0.1)
    way, places = (
        degrees((60.0, 0.0), (0.0, 0.0)),
        degrees((20.0, 0.0), (40.0, 0.0), (60.0, 0.0), (40.0, 0.0), (20.0, 0.0)),
    )
    world.vehicle.go(way, places)
    *readings, reached = world.arrive(300.0)
    assert len(readings) == 5 and isinstance(reached, Reached)
    for reading, place in zip(readings, places, strict=True):
        # A position may be a second old, which is 2 m.
        assert to_plane([reading.position])[0] == pytest.approx(to_plane([place])[0], abs=2.5)
    assert (np.diff([reading.time for reading in readings]) > 7.0).all()


def test_a_message_that_it_is_there_may_be_lost():
    world = World()
    world.pilot.silent = {"mission_item_reached"}
    world.vehicle.go(WAY, PLACES)
    *readings, reached = world.arrive(60.0)
    assert len(readings) == 3 and to_plane([reached.position])[0] == pytest.approx((30.0, 40.0), abs=0.1)


def test_one_that_stands_still_is_told_again_where_to_go():
    world = World()
    world.vehicle.go(degrees((30.0, 0.0), (30.0, 40.0), (0.0, 40.0)), PLACES)
    world.run(25.0)
    world.pilot.finished = True  # it is past the first waypoint, and has forgotten what it does
    x, y = to_plane([(world.pilot.x, world.pilot.y)])[0]
    assert x == pytest.approx(30.0, abs=0.01) and y > 0
    *readings, _ = world.arrive(90.0)
    assert world.told == ["boat: has not moved for 20 s: told again where to go", "boat: moves again"]
    assert world.pilot.starts[1][1] == 3 and world.pilot.odometer == pytest.approx(100.0, abs=0.5)
    assert len(readings) == 1  # two places were passed before


def test_a_link_that_is_cut_is_told_and_the_way_goes_on():
    world = World()
    world.vehicle.go(WAY, [])
    world.run(12.0)
    world.radio.cut = True
    world.run(20.0)
    assert world.told == ["boat: autopilot not heard for 5 s"]
    world.radio.cut = False
    reached = world.arrive(60.0)[-1]  # it got there meanwhile
    assert reached.position == pytest.approx(WAY[-1], abs=0.4 * METRE)
    assert "boat: autopilot heard again" in world.told


def test_a_mission_that_is_refused_is_told_and_tried_again():
    world = World()
    world.pilot.refuses = True
    world.vehicle.go(WAY, [])
    world.run(15.0)
    assert world.told == [
        "boat: the autopilot does not take its mission: "
        "it is denied, as waypoints outside of the autopilot's fence are; trying again"
    ]
    assert world.channel.names.count("mission_clear_all") in (2, 4) and world.pilot.starts == []
    world.pilot.refuses = False
    world.arrive(90.0)
    world.started_right(WAY)


@pytest.mark.parametrize(("kind", "loss"), [(ARDUPILOT, 0.0), (PX4, 0.0), (ARDUPILOT, 0.2), (PX4, 0.2)])
def test_its_fence_is_there_before_it_goes(kind, loss):
    world = World(kind, fence=fence_items(Fence(AREA, (ZONE,))), loss=loss, seed=1)
    world.pilot.refuses_fence = True
    world.vehicle.go(WAY, [])
    world.run(20.0)
    refused = [line for line in world.told if "does not take its fence" in line]
    assert len(refused) == 1 and world.pilot.starts == [] and world.pilot.mission == []
    world.pilot.refuses_fence = False
    world.arrive(120.0)
    world.started_right(WAY)
    told = [(item.command, item.param1, item.y / 1e7, item.x / 1e7) for item in world.pilot.fence]
    expected = [(5001, 4, *corner) for corner in AREA] + [(5002, 4, *corner) for corner in ZONE]
    assert [each[:2] for each in told] == [each[:2] for each in expected]
    np.testing.assert_allclose(np.array(told)[:, 2:], np.array(expected)[:, 2:], atol=1e-7)
    assert "boat: the autopilot has its fence: 8 vertices" in world.told
    uploads = world.channel.names.count("mission_count")
    world.vehicle.go(degrees((0.0, 0.0)), [])
    world.arrive(120.0)
    if not loss:
        assert world.channel.names.count("mission_count") == uploads + 1  # of the mission; the fence it has


def test_people_arm_it_and_take_it_over():
    world = World()
    world.pilot.armed = False
    world.vehicle.go(WAY, [])
    world.run(4.0)
    assert world.told == ["boat: not armed: arm it; it goes then"] and world.pilot.starts == []
    world.pilot.armed, world.pilot.mode = True, 0  # MANUAL
    world.run(4.0)
    assert world.told[1:] == ["boat: steered by somebody: put it into LOITER; it goes then"]
    assert world.pilot.mode == 0 and world.pilot.starts == []
    world.pilot.mode = 5
    world.run(10.0)
    assert world.pilot.following
    world.pilot.mode = 0
    world.run(10.0)
    assert world.told[2:] == ["boat: another mode was chosen: it goes on once it is back in AUTO"]
    assert world.pilot.mode == 0
    before = len(world.channel.names)
    for _ in range(100):  # as its robot does while it cannot write
        world.vehicle.hold()
    assert len(world.channel.names) == before
    world.run(5.0)
    assert world.pilot.mode == 0  # whoever steers it has it
    world.vehicle.go(WAY, [])
    world.pilot.mode = 5
    world.arrive(60.0)
    assert world.told[3:] == [world.told[1]]


def test_one_that_is_taken_over_and_given_back_goes_on():
    world = World()
    world.vehicle.go(WAY, [])
    world.run(10.0)
    world.pilot.mode = 0
    world.run(10.0)
    world.pilot.mode = 10
    world.arrive(60.0)
    assert world.told[-1] == "boat: back in AUTO"


def test_it_holds_when_it_is_closed(monkeypatch):
    world = World()
    world.vehicle.go(WAY, [])
    world.run(10.0)
    assert world.pilot.following

    def sleep(seconds):
        world.radio.time += seconds
        world.pilot.step(seconds)

    monkeypatch.setattr(drive.time, "sleep", sleep)
    world.vehicle.close()
    world.vehicle.close()
    assert world.pilot.mode == 5 and world.channel.closed


def test_without_values_nothing_is_measured_and_that_is_told():
    world = World()
    world.pilot.silent = {"named_value_float"}
    world.run(5.0)
    world.vehicle.go(WAY, PLACES)
    assert len(world.arrive(60.0)) == 1
    assert world.told == ["boat: no value of the sensor: nothing is measured where it should be"]


def test_waypoints_outside_of_the_fence_are_moved_and_told():
    world = World(margin=2.0)
    corner = degrees((222.64 + 30.0, 222.64 + 10.0))  # 10 m inside of the zone, from below
    world.vehicle.go(degrees((0.0, 1200.0)) + corner, [])
    assert world.told[0] == "boat: waypoint 1 is moved by 88.8 m, into the fence"
    assert world.told[1] == "boat: waypoint 2 is moved by 12.0 m, into the fence"
    world.run(4.0)
    places = [(item.y / 1e7, item.x / 1e7) for item in world.pilot.mission[2:]]
    x, y = to_plane(places).T
    assert y == pytest.approx([1113.2 - 2.0, 222.64 - 2.0], abs=0.02) and x == pytest.approx([0.0, 252.64], abs=0.02)
    with pytest.raises(InputError, match="--with margin=2000: nothing of the area is left"):
        World(margin=2000.0)


def test_messages_for_others_are_left_alone():
    """Another ground station uploads a mission at the same time."""
    world = World()
    world.vehicle.go(WAY, [])
    world.run(0.2)
    before = len(world.channel.names)
    world.pilot.mav.mission_request_int_send(255, 190, 2)
    world.pilot.mav.mission_ack_send(255, 190, 4)
    other = type(world.pilot.mav)(world.pilot.mav.file, srcSystem=7, srcComponent=1)
    other.heartbeat_send(11, ARDUPILOT, 129, 0, 4)
    other.global_position_int_send(0, 0, 5, 0, 0, 0, 0, 0, 0)
    world.run(0.1)
    assert "mission_clear_all" not in world.channel.names[before:]
    assert world.vehicle.where().position == pytest.approx((10.0, 0.0), abs=1e-5)
    world.arrive(60.0)
