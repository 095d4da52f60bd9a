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
from maipp.fleet.mavlink.course import Choice, Told
from maipp.fleet.mavlink.drive import Drive, Ground, Senses
from maipp.fleet.mavlink.inside import Inside
from maipp.fleet.mavlink.mission import items_of
from maipp.fleet.mavlink.modes import ARDUPILOT, PX4, modes_of
from maipp.fleet.mavlink.passing import Passing
from maipp.fleet.mavlink.sensor import Sensor
from maipp.fleet.mavlink.upload import Upload
from maipp.fleet.vehicle import Reached, Reading, Vehicle
from maipp.missions.fences import Fence
from maipp.missions.vehicle import Vehicle as Kind
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

    def __init__(self, kind=ARDUPILOT, margin=1.0, **radio):
        self.radio, self.told = Radio(**radio), []
        boat = Kind("boat", "px4" if kind == PX4 else "ardupilot")
        self.modes = modes_of(kind, "boat")
        modes = {"mode": self.modes.hold.custom, "auto": self.modes.mission.custom}
        self.pilot = ScriptedAutopilot(self.radio, kind, **modes)
        self.pilot.value = lambda x, y: float(to_plane([(x, y)])[0, 0])  # metres east
        self.channel = Channel(self.radio, self)
        inside = Inside(Fence(AREA, (ZONE,)), margin, to_plane)
        ground = Ground(to_plane, to_user, inside, 20.0, 5.0)
        autopilot = Autopilot(0, 245, self.channel.send)
        choice, senses = Choice(boat, lambda: 2.0), Senses(Sensor(2.0), "turbidity")
        said = Told("boat", self.told.append)
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


def test_modes():
    assert modes_of(ARDUPILOT, "rover").hold.custom == 4 and modes_of(ARDUPILOT, "boat", "HOLD").hold.custom == 4
    assert modes_of(ARDUPILOT, "copter").mission.custom == 3
    px4 = modes_of(PX4, "boat")
    assert (px4.mission.custom, px4.hold.custom) == (0x04040000, 0x03040000)
    for wrong in [(ARDUPILOT, "boat", "AUTO"), (ARDUPILOT, "boat", "RTL"), (PX4, "boat", "LAND")]:
        with pytest.raises(InputError, match="--with hold="):
            modes_of(*wrong)


@pytest.mark.parametrize("px4", [False, True])
def test_items_are_those_of_mission_files(px4):
    vehicle = Kind("copter", "px4" if px4 else "ardupilot", altitude=20.0)
    items, first = items_of(np.array([10.0, 0.0]), np.array(WAY), 1.5, vehicle, px4=px4)
    assert [item.command for item in items] == ([178, 16, 16] if px4 else [16, 178, 16, 16])
    assert first == len(items) - 2 and items[first].parameters[4:] == pytest.approx((*reversed(WAY[0]), 20.0))


class Sent:
    """What an upload sends."""

    def __init__(self):
        self.names = []

    def __call__(self, name, *fields):
        self.names.append((name, fields[0]))


class Message:
    """A message of an autopilot."""

    mission_type = 0

    def __init__(self, kind, seq=None, type=None):
        self.kind, self.seq, self.type = kind, seq, type

    def get_type(self):
        return self.kind


def test_an_acknowledgement_of_an_earlier_upload_is_not_taken_for_this_one():
    items, _ = items_of(np.array([10.0, 0.0]), np.array(WAY), 1.5, Kind(), px4=True)
    sent = Sent()
    upload = Upload(items, sent)
    upload.begin(0.0)
    upload.hear(Message("MISSION_ACK", type=0), 0.1)
    upload.hear(Message("MISSION_REQUEST_INT", seq=0), 0.2)
    upload.hear(Message("MISSION_REQUEST_INT", seq=99), 0.2)
    upload.hear(Message("MISSION_ACK", type=0), 0.3)
    assert not upload.done
    for seq in (1, 1, 2):
        upload.hear(Message("MISSION_REQUEST", seq=seq), 0.4)
    upload.hear(Message("MISSION_ACK", type=13), 0.5)  # an item came twice
    assert not upload.done and upload.problem is None
    upload.hear(Message("MISSION_ACK", type=0), 0.6)
    assert upload.done and not upload.resumed
    assert sent.names == [("mission_count", 3), *(("mission_item_int", seq) for seq in (0, 1, 1, 2))]
    # It was an old one after all: the last item had been lost.
    upload.hear(Message("MISSION_REQUEST", seq=2), 0.9)
    upload.hear(Message("MISSION_ACK", type=0), 1.0)
    assert upload.resumed and sent.names[-1] == ("mission_item_int", 2)


def test_an_upload_without_any_answer_ends():
    sent = Sent()
    upload = Upload(items_of(np.array([10.0, 0.0]), np.array(WAY), 1.5, Kind(), px4=True)[0], sent)
    upload.begin(0.0)
    now = 0.0
    while upload.problem is None and now < 100:
        now += 0.5
        upload.tick(now)
    assert upload.problem == "it does not answer" and now == pytest.approx(3 * 6 * 1.5, abs=1.5)
    assert {name for name, _ in sent.names} == {"mission_count"}


def test_passing_a_turn_and_a_gap_in_positions():
    way = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 50.0]])
    places = [np.array(place) for place in [(20.0, 0.0), (40.0, 0.0), (100.0, 20.0), (100.0, 50.0)]]
    passing = Passing(way, places, 20.0, 0.0)
    assert passing.move(np.array([10.0, 0.5]), 5.0) == []
    first, second = passing.move(np.array([50.0, 0.5]), 25.0)  # silent for 20 s
    assert (first.time, second.time) == (10.0, 20.0) and first.position == pytest.approx((20.0, 0.5))
    assert passing.progress == 50.0 and passing.since == 10.0
    assert passing.move(np.array([45.0, 0.0]), 26.0) == [] and passing.progress == 50.0  # never back
    passing.move(np.array([98.0, 2.0]), 50.0)  # it cuts the corner
    (third,) = passing.move(np.array([100.5, 22.0]), 60.0)
    assert third.position == pytest.approx((100.3, 20.0), abs=0.5)
    (last,) = passing.at_vertex(2, np.array([100.0, 48.0]), 75.0)
    assert last.time == 75.0 and passing.progress == passing.length


def test_a_sensor_s_value_counts_for_some_time():
    sensor = Sensor(2.0)
    assert sensor.at(1.0) is None
    for time, value in ((1.0, 10.0), (2.0, 20.0), (9.0, 90.0)):
        sensor.heard(time, value)
    assert [sensor.at(time) for time in (0.5, 1.0, 1.9, 3.9, 5.0, 7.5, 12.0)] == [10, 10, 10, 20, None, 90, None]
