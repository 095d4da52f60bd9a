"""Measurements of a live survey: a set of them, whatever the order they came in."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maipp.live.measurements import Measurements, Sample

NUMBER = st.floats(-1, 1, width=32)
SAMPLES = st.lists(st.builds(Sample, NUMBER, st.integers(0, 2), NUMBER, NUMBER, NUMBER), max_size=24)


def taken_in(samples, room=3):
    measurements = Measurements(3, room, np.dtype("float32"))
    for sample in samples:
        measurements.add(sample)
    return measurements


@given(samples=SAMPLES, data=st.data())
def test_neither_order_nor_copies_matter(samples, data):
    copies = data.draw(
        st.permutations(samples + data.draw(st.lists(st.sampled_from(samples)) if samples else st.just([])))
    )
    for mine, other in zip(taken_in(samples).slots(), taken_in(copies).slots(), strict=True):
        assert mine.tobytes() == other.tobytes()


def test_each_robot_has_its_slots_in_the_order_of_time():
    late, early, other = (
        Sample(2.0, 1, 0.1, 0.2, 0.3),
        Sample(1.0, 1, 0.4, 0.5, 0.6),
        Sample(1.5, 2, 0.7, 0.8, 0.9),
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
    measurements = Measurements(2, room, np.dtype("float32"))
    measurements._ordered[1] = [Sample(0.0, 1, 0.0, 0.0, 0.0)] * most
    slots = measurements.slots_per_robot
    assert slots >= most and slots % room == 0 and (slots // room).bit_count() == 1
    assert slots == room or slots < 2 * most


def test_a_set_knows_its_size():
    measurements = taken_in([Sample(index, 0, 0, 0, 0) for index in range(20)])
    assert len(measurements) == 20 and measurements.slots_per_robot == 24 and len(measurements.slots().y) == 72
