"""Measurements of a live survey: a set of them, whatever the order they came in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.belief.refit import Hyperparameters
from maipp.live.gate import LEVEL, Gate
from maipp.live.measurements import MeasurementSet, Override, room_for
from maipp.live.scaled_measurement import ScaledMeasurement

NUMBER = st.floats(-1, 1, width=32).map(lambda number: number + 0.0)  # without -0.0, as events are read
SAMPLES = st.lists(st.builds(ScaledMeasurement, NUMBER, st.integers(0, 2), NUMBER, NUMBER, NUMBER), max_size=24)


def empty(room=3, level=0.0):
    return MeasurementSet(3, room, np.dtype("float32"), Gate(Hyperparameters(0.0, 1.0, 0.45, 1e-4), level))


def taken_in(samples, room=3, level=0.0):
    measurements = empty(room, level)
    for index, sample in enumerate(samples):
        measurements.add(sample, f"m{index}")
    return measurements


@pytest.mark.parametrize("level", [0.0, LEVEL])
@given(samples=SAMPLES, data=st.data())
def test_neither_order_nor_copies_matter(samples, level, data):
    copies = data.draw(
        st.permutations(samples + data.draw(st.lists(st.sampled_from(samples)) if samples else st.just([])))
    )
    both = taken_in(samples, level=level).slots(), taken_in(copies, level=level).slots()
    for mine, other in zip(*both, strict=True):
        assert mine.tobytes() == other.tobytes()


def test_each_robot_has_its_slots_in_the_order_of_time():
    late, early, other = (
        ScaledMeasurement(2.0, 1, 0.1, 0.2, 0.3),
        ScaledMeasurement(1.0, 1, 0.4, 0.5, 0.6),
        ScaledMeasurement(1.5, 2, 0.7, 0.8, 0.9),
    )
    x, y, time, by, mask = taken_in([late, other, early]).slots()
    assert by.tolist() == [0] * 3 + [1] * 3 + [2] * 3
    assert mask.tolist() == [False] * 3 + [True, True, False] + [True, False, False]
    np.testing.assert_array_equal(y[mask], np.array([0.6, 0.3, 0.9], np.float32))
    np.testing.assert_array_equal(x[mask], np.array([[0.4, 0.5], [0.1, 0.2], [0.7, 0.8]], np.float32))
    np.testing.assert_array_equal(time[mask], [1.0, 2.0, 1.5])
    assert np.isinf(time[~mask]).all()


@given(most=st.integers(0, 2000), room=st.integers(1, 300))
def test_room_doubles_until_the_busiest_robot_has_enough(most, room):
    slots = room_for(most, room)
    assert slots >= most and slots % room == 0 and (slots // room).bit_count() == 1
    assert slots == room or slots < 2 * most


def test_a_set_knows_its_size():
    measurements = taken_in([ScaledMeasurement(index, 0, 0, 0, 0) for index in range(20)])
    assert len(measurements) == 20 and len(measurements.slots().y) == 72


def test_what_a_person_decides_counts_the_latest_first_and_before_it_is_known():
    sample, other = ScaledMeasurement(1.0, 0, 0.1, 0.2, 8.0), ScaledMeasurement(2.0, 0, 0.9, 0.9, 0.1)
    measurements = empty(level=LEVEL)
    measurements.decide("a", Override(3.0, "keep", True))
    measurements.add(sample, "a")
    measurements.add(other, "b")
    assert len(measurements) == 2 and measurements.everything[0] == ("a", sample, None)
    measurements.decide("a", Override(4.0, "withdraw", False))
    measurements.decide("a", Override(2.0, "earlier", True))
    assert len(measurements) == 1 and measurements.everything[0] == ("a", sample, "withdrawn")
    measurements.add(sample, "again")  # another report of the same
    assert measurements.reports([sample]) == ["a", "again"] and len(measurements) == 1
    measurements.decide("again", Override(5.0, "keep", True))
    assert len(measurements) == 2


def test_values_that_no_float_can_work_with_are_cut_when_kept():
    measurements = taken_in([ScaledMeasurement(1.0, 0, 0.1, 0.2, 1e300)], level=LEVEL)
    assert not len(measurements) and np.isfinite(measurements.slots().y).all()
    measurements.decide("m0", Override(1.0, "k", True))
    assert measurements.slots().y.max() == 1e4
