"""A simulated vehicle: kinematics that can be worked out by hand, errors of the size that was asked for."""

import json
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.fleet import simulated
from maipp.fleet.clock import VirtualClock
from maipp.fleet.simulated import Errors, Simulated
from maipp.fleet.vehicle import Reached, Reading, Vehicle
from maipp.live.units import Units

UNITS = Units((1.0, 1.0))
START = np.array([0.2, 0.2])
INTERVAL = 0.1
# Positions are told with the digits of float32, way and times with 7 decimals.
ROUNDED = 2e-7


def field(points):
    """A plane, of which a value tells where it was taken."""
    return 3.0 * points[:, 0] - points[:, 1]


def vehicle(clock, speed=0.5, **more):
    return Simulated(UNITS, START, speed, INTERVAL, field, clock, **more)


def drive(boat, clock, until=100.0) -> list[Any]:
    """Everything that is reported until it holds, the clock going from one event to the next."""
    reports = boat.poll()
    while (time := boat.next_time()) is not None and time <= until:
        clock.time = max(time, clock.time)
        reports += boat.poll()
    return reports


def every(way, spacing, first):
    """Places along a polyline at `first`, `first + spacing` and so on."""
    way = np.asarray(way, float)
    marks = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    at = np.arange(first, marks[-1], spacing)
    return np.stack([np.interp(at, marks, way[:, axis]) for axis in (0, 1)], axis=-1), at, marks[-1]


def test_it_is_a_vehicle():
    assert isinstance(vehicle(VirtualClock()), Vehicle)


places = st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0))


@settings(deadline=None)
@given(st.lists(places, min_size=1, max_size=4), st.floats(0.05, 3.0), st.floats(0.0, 50.0))
def test_it_arrives_after_distance_over_speed(waypoints, speed, begin):
    clock = VirtualClock(begin)
    boat = vehicle(clock, speed)
    _, _, length = every([START, *waypoints], 1.0, 0.0)
    boat.go(waypoints, [])
    (reached,) = drive(boat, clock, until=1e4)
    assert isinstance(reached, Reached)
    assert reached.time == pytest.approx(begin + length / speed, abs=ROUNDED)
    assert reached.position == pytest.approx(waypoints[-1], abs=ROUNDED)
    assert reached.travelled == pytest.approx(length, abs=ROUNDED)
    assert boat.next_time() is None and boat.poll() == []


@pytest.mark.parametrize("first", [0.02, 0.05, 0.1])
@pytest.mark.parametrize(
    "way",
    [
        [(0.8, 0.2)],
        [(0.26, 0.2), (0.2, 0.2)],  # out and back, with every place passed twice
        [(0.5, 0.2), (0.2, 0.2), (0.2, 0.6)],
        [(0.5, 0.5), (0.5, 0.5), (0.9, 0.1)],  # a waypoint twice
    ],
)
def test_it_measures_at_the_places_it_was_told_also_on_a_way_out_and_back(way, first):
    clock = VirtualClock()
    boat = vehicle(clock)
    boat._measured = first - INTERVAL  # the rest of an interval is behind it
    told, at, length = every([START, *way], INTERVAL, first)
    boat.go(way, [tuple(place) for place in told.tolist()])
    *readings, reached = drive(boat, clock)
    assert isinstance(reached, Reached) and reached.travelled == pytest.approx(length, abs=ROUNDED)
    assert [reading.position for reading in readings] == [pytest.approx(place, abs=ROUNDED) for place in told.tolist()]
    assert [reading.time for reading in readings] == pytest.approx((at / 0.5).tolist(), abs=ROUNDED)
    assert [reading.travelled for reading in readings] == pytest.approx(at.tolist(), abs=ROUNDED)
    assert [reading.value for reading in readings] == pytest.approx(field(told).tolist(), abs=1e-6)


def test_a_place_beside_the_way_is_measured_where_it_comes_nearest_and_before_the_end():
    clock = VirtualClock()
    boat = vehicle(clock)
    boat.go([(0.4, 0.2)], [(0.3, 0.21), (0.4, 0.23)])
    first, second, reached = drive(boat, clock)
    assert isinstance(first, Reading) and isinstance(second, Reading) and isinstance(reached, Reached)
    assert second.time == reached.time and second.travelled == reached.travelled


@settings(deadline=None)
@given(st.lists(st.floats(0.0, 1.5), max_size=8), st.floats(0.0, 0.01))
def test_where_changes_nothing(moments, noise):
    """Asked or not, the same is reported, errors and all; and asked twice it says the same."""
    errors = Errors((0.01, 0.0), noise, noise, 0.1, seed=3)
    told = []
    for asked in ([], sorted(moments)):
        clock = VirtualClock()
        boat = vehicle(clock, errors=errors)
        boat.go([(0.8, 0.2)], [(0.3, 0.2), (0.5, 0.2)])
        reports = []
        for moment in asked:
            reports += drive(boat, clock, until=moment)
            clock.time = max(moment, clock.time)
            assert boat.where() == boat.where()
        told.append([*reports, *drive(boat, clock)])
    assert told[0] == told[1] and len(told[0]) == 3


def test_it_holds_where_it_is_and_goes_on_from_there():
    clock = VirtualClock()
    boat = vehicle(clock)
    boat.go([(0.8, 0.2)], [(0.3, 0.2), (0.7, 0.2)])
    clock.time = 0.6
    boat.hold()
    (reading,) = cast(list[Any], boat.poll())  # what it had passed; the rest of the way is forgotten
    assert reading.position == pytest.approx((0.3, 0.2), abs=ROUNDED)
    clock.time = 5.0
    assert boat.poll() == [] and boat.where().position == pytest.approx((0.5, 0.2), abs=ROUNDED)
    boat.go([(0.5, 0.6)], [(0.5, 0.3)])
    reading, reached = drive(boat, clock)
    assert reading.time == pytest.approx(5.2) and reached.time == pytest.approx(5.8)
    assert reached.travelled == pytest.approx(0.7)


def test_a_way_of_no_length_is_arrived_at_once():
    clock = VirtualClock(2.0)
    boat = vehicle(clock)
    boat.go([tuple(START)], [tuple(START)])
    reading, reached = cast(list[Any], boat.poll())
    assert reading.time == reached.time == 2.0 and reached.travelled == 0.0


def test_a_place_far_outside_changes_nothing():
    clock = VirtualClock()
    boat = vehicle(clock)
    boat.go([(0.4, 0.2)], [])
    with pytest.raises(InputError, match="measure: .* far outside"):
        boat.go([(0.9, 0.9)], [(0.3, 0.3), (77.0, 0.0)])
    (reached,) = drive(boat, clock)
    assert reached.position == pytest.approx((0.4, 0.2), abs=ROUNDED)


@pytest.mark.parametrize("down", [0.3, 0.6, 3.0])
def test_killed_it_goes_on_with_its_way_and_is_found_there(tmp_path, down):
    """The boat goes on along its way while the computer on it is down; nothing is travelled twice or for nothing."""
    clock, path = VirtualClock(1.0), tmp_path / "vehicle.json"
    boat = vehicle(clock, state=path)
    boat.go([(0.5, 0.2), (0.5, 0.4)], [])
    clock.time += down
    again = vehicle(clock, state=path)
    gone = min(0.5 * down, 0.5)
    fix = again.where()
    assert fix.travelled == pytest.approx(gone, abs=ROUNDED)
    assert fix.position == pytest.approx((0.2 + min(gone, 0.3), 0.2 + max(gone - 0.3, 0)), abs=ROUNDED)
    assert again.next_time() is None  # it holds
    third = vehicle(clock, state=path)
    assert third.where() == fix


def test_a_full_disk_does_not_stop_it(tmp_path, monkeypatch):
    clock = VirtualClock()
    boat = vehicle(clock, state=tmp_path / "vehicle.json")

    def full(path, content):
        raise InputError(f"{path}: no space left on device")

    monkeypatch.setattr(simulated, "write_atomic", full)
    boat.go([(0.4, 0.2)], [])
    for _ in range(3):
        boat.hold()  # as its robot does again and again while it cannot write
    boat.go([(0.4, 0.2)], [])
    assert isinstance(drive(boat, clock)[-1], Reached)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"since": 0, "odometer": 0, "measured": 0, "leg": []}', "\xff", "{"])
def test_a_damaged_state_is_told(tmp_path, text):
    path = tmp_path / "vehicle.json"
    path.write_text(text, "latin-1")
    with pytest.raises(InputError, match="vehicle.json: not where a simulated vehicle was"):
        vehicle(VirtualClock(), state=path)


def test_the_state_has_only_numbers_of_today(tmp_path):
    path = tmp_path / "vehicle.json"
    with pytest.raises(InputError, match="not where"):
        path.write_text(json.dumps({"since": float("nan"), "odometer": 0, "measured": 0, "leg": [[0, 0]]}))
        vehicle(VirtualClock(), state=path)


def test_it_drifts_while_it_holds_and_not_under_way():
    clock = VirtualClock()
    boat = vehicle(clock, errors=Errors(drift=(0.01, -0.02)))
    clock.time = 2.0
    assert boat.where().position == pytest.approx((0.22, 0.16), abs=ROUNDED)
    assert boat.where().travelled == 0.0
    boat.go([(0.22, 0.66)], [])  # from where it drifted to
    (reached,) = drive(boat, clock)
    assert reached.time == pytest.approx(3.0) and reached.position == pytest.approx((0.22, 0.66), abs=ROUNDED)
    clock.time = 4.0
    assert boat.where().position == pytest.approx((0.23, 0.64), abs=ROUNDED)


def test_errors_have_the_size_that_was_asked_for():
    """Of n = 4,000 draws a standard deviation is known to 1.1 % and a share of 0.05 to 0.0034 (one sigma): four."""
    n, spread, noise, bad = 4000, 0.004, 0.03, 0.05
    clock = VirtualClock()
    boat = Simulated(UNITS, START, 1e-4, 1e-4, field, clock, errors=Errors(position=spread, value=noise, bad=bad))
    at = 0.2 + 0.1 * (np.arange(n) + 1) / n
    boat.go([(0.3, 0.2)], [(float(x), 0.2) for x in at])
    *readings, _ = drive(boat, clock, until=1e6)
    assert len(readings) == n
    gaps = np.array([reading.position for reading in readings]) - np.stack([at, np.full(n, 0.2)], axis=-1)
    assert np.abs(gaps.mean(axis=0)).max() < 4 * spread / n**0.5
    assert gaps.std(axis=0) == pytest.approx(spread, rel=0.05)
    assert abs(np.corrcoef(gaps.T)[0, 1]) < 4 / n**0.5 and abs(np.corrcoef(gaps[1:, 0], gaps[:-1, 0])[0, 1]) < 0.07
    values = np.array([reading.value for reading in readings])
    wrong = np.isin(values, (-9999.0, 1e4, 0.0))
    assert wrong.mean() == pytest.approx(bad, abs=4 * (bad * (1 - bad) / n) ** 0.5)
    rest = (values - field(np.stack([at, np.full(n, 0.2)], axis=-1)))[~wrong]
    assert rest.std() == pytest.approx(noise, rel=0.05) and abs(rest.mean()) < 4 * noise / n**0.5


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"bad": 1.5}, "bad: 1.5 is no chance"),
        ({"bad": float("nan")}, "bad: nan"),
        ({"position": -1.0}, "position: -1.0"),
        ({"value": float("inf")}, "noise: inf"),
        ({"drift": (0.0, float("nan"))}, "drift:"),
    ],
)
def test_errors_that_cannot_be_are_refused(wrong, problem):
    with pytest.raises(InputError, match=problem):
        Errors(**wrong)
