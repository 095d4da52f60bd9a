"""The parts of the MAVLink vehicle: modes, items, uploads, passing places, a sensor's values."""

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fleet.mavlink.mission_items import items_of
from maipp.fleet.mavlink.modes import ARDUPILOT, PX4, modes_of
from maipp.fleet.mavlink.passing import Passing
from maipp.fleet.mavlink.sensor import Sensor
from maipp.fleet.mavlink.upload import Upload
from maipp.route_files.vehicle_settings import VehicleSettings as Kind

WAY = [(10.0003, 0.0), (10.0003, 0.0004)]


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
