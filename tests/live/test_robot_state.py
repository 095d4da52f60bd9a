import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.engine.polyline import place_at
from maipp.live.robot_state import GONE, STOPPED, TRAVELLING, RobotState

BENT = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1]])


def robot(leg=BENT, time=1.0, odometer=0.4, planned=0.0):
    one = RobotState("a", 0.5, 2.0, None, None)
    one.arrive(time, odometer, planned, leg, {"answer": "go"}, "plan", None)
    return one


@pytest.mark.parametrize(
    ("position", "way"),
    [
        ([0.2, 0.1], 0.3),  # at the end of the leg: all of it, bend included
        ([0.2, 0.0], 0.2),  # early
        ([0.1, 0.0], 0.1),
        ([0.0, 0.0], 0.0),  # it has not moved
        ([0.2, 0.11], 0.31),  # beyond the end
        ([0.21, 0.1], 0.31),  # beside it
        ([-0.1, 0.0], 0.1),  # the other way
    ],
)
def test_the_way_follows_from_positions(position, way):
    assert robot().travelled(np.array(position), None, 1.5) == pytest.approx(0.4 + way)


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), time=st.floats(1, 3))
def test_no_way_is_shorter_than_the_straight_one(x, y, time):
    assert robot().travelled(np.array([x, y]), None, time) >= 0.4 + np.hypot(x, y) - 1e-12


@pytest.mark.parametrize(("time", "way"), [(1.0, 0.0), (1.1, 0.0), (1.4, 0.2), (9.0, 0.2)])
def test_out_and_back_is_told_by_the_time(time, way):
    """Or a robot that ends where it began would travel for ever on its budget."""
    there = robot(leg=np.array([[1.0, 1.0], [1.0, 0.9], [1.0, 1.0]]))
    assert there.travelled(np.array([1.0, 1.0]), None, time) == pytest.approx(0.4 + way)
    beside = there.travelled(np.array([0.999, 1.001]), None, time)
    assert beside == pytest.approx(0.4 + way, abs=0.003)


def test_an_odometer_counts_but_never_backwards():
    assert robot().travelled(np.array([0.2, 0.1]), 0.77, 1.5) == 0.77
    assert robot().travelled(np.array([0.2, 0.1]), 0.1, 1.5) == 0.4


@pytest.mark.parametrize(
    ("planned", "odometer", "left"),
    [
        (0.6, 0.6, 0.2),  # planned here: its report is on the way
        (0.6, 0.595, 0.2),  # a little short of it
        (0.6, 0.62, 0.18),
        (0.6, 0.55, 0.05),  # early: still to be taken
    ],
)
def test_a_planned_measurement_counts_once_the_robot_is_there(planned, odometer, left):
    one = robot(planned=planned)
    one.note_measurement(1.0, 0.4)
    assert one.to_next_measurement(2.0, odometer, 0.2) == pytest.approx(left)


@pytest.mark.parametrize(
    ("measured", "odometer", "left"),
    [
        ([], 0.0, 0.2),
        ([], 0.15, 0.05),
        ([], 0.199, 0.001),
        ([], 0.45, 0.15),
        ([(2.0, -1.0)], 0.45, 0.2),  # just measured
        ([(1.0, -1.0)], 0.5, 0.1),  # at the arrival before, 0.1 ago
        ([(1.5, -1.0)], 0.5, 0.15),  # half way since
        ([(1.5, 0.48)], 0.5, 0.18),  # its own odometer says where
        ([(3.0, -1.0), (1.0, -1.0)], 0.5, 0.1),  # a report from the future is not its last one
    ],
)
def test_measurements_are_due_an_interval_after_the_last(measured, odometer, left):
    one = robot(odometer=0.4 if odometer >= 0.4 else 0.0)
    for time, told in measured:
        one.note_measurement(time, None if told < 0 else told)
    assert one.to_next_measurement(2.0, odometer, 0.2) == pytest.approx(left)


@given(
    ways=st.lists(st.floats(0, 5), max_size=4),
    odometer=st.floats(0, 5),
    interval=st.floats(0.01, 1),
    time=st.floats(0, 9),
)
def test_what_is_left_to_the_next_measurement_is_within_an_interval(ways, odometer, interval, time):
    one = RobotState("a", 0.5, 2.0, None, None)
    for index, way in enumerate(ways):
        one.note_measurement(float(index), way)
    assert 0 < one.to_next_measurement(time, odometer, interval) <= interval


@given(distance=st.floats(0, 1))
def test_along_a_bent_way(distance):
    x, y = place_at(BENT, distance)
    assert (x, y) == pytest.approx((min(distance, 0.2), min(max(distance - 0.2, 0.0), 0.1)))


def test_dead_reckoning():
    np.testing.assert_allclose(robot().where(1.2), [0.1, 0.0])
    np.testing.assert_allclose(robot().where(9.0), [0.2, 0.1])
    np.testing.assert_allclose(robot().where(0.0), [0.0, 0.0])


def test_statuses():
    assert robot().status == TRAVELLING and robot(leg=BENT[:1]).status == STOPPED
    one = robot()
    one.leave(0.5, None)  # it has reported since
    assert one.status == TRAVELLING and one.message == "plan"
    one.leave(1.2, None)
    assert one.status == GONE and one.message is None
    one.announce(1.1, np.array([0.9, 0.9]), "older")
    assert one.status == GONE and one.message is None
    one.announce(1.3, np.array([0.2, 0.1]), "newer")
    assert one.message == "newer" and one.odometer == pytest.approx(0.7)


@given(order=st.permutations([(3.0, "b", 9.0), (1.0, "a", 1.0), (3.0, "c", 5.0)]))
def test_the_latest_budget_counts_in_any_order(order):
    one = robot()
    for time, name, budget in order:
        one.grant(budget, time, name)
    assert one.budget == 5.0


def test_the_way_gone_follows_the_speeds():
    one = robot()  # 0.5 from time 1 on, on a leg of 0.3
    one.pace(0.25, 1.2, "b")
    one.pace(1.0, 1.1, "a")  # told later, and was so before
    assert one.speed == 0.25
    assert one.covered(1.1) == pytest.approx(0.05) and one.covered(1.2) == pytest.approx(0.15)
    assert one.covered(1.4) == pytest.approx(0.2) and one.where(1.4) == pytest.approx([0.2, 0.0])
    assert one.ahead(1.3) == pytest.approx(np.array([[0.175, 0.0], [0.2, 0.0], [0.2, 0.1]]))
    assert one.ahead(9.0) == pytest.approx(np.array([[0.2, 0.1]]))


@given(moves=st.permutations([(1.2, "b", 0.25), (1.1, "a", 1.0), (1.2, "c", 0.75)]))
def test_of_several_speeds_the_latest_decides_in_whatever_order(moves):
    one = robot()
    for time, event, speed in moves:
        one.pace(speed, time, event)
    assert (one.speed, one.speeds) == (0.75, [(-1.0, "", 0.5), (1.1, "a", 1.0), (1.2, "b", 0.25), (1.2, "c", 0.75)])
