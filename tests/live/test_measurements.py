import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maipp.live.measurements import Measurements, Sample, slots_for

NUMBER = st.floats(-1, 1, width=32)
SAMPLES = st.lists(st.builds(Sample, NUMBER, st.integers(0, 2), NUMBER, NUMBER, NUMBER), max_size=12)


def taken_in(samples, prior=0):
    measurements = Measurements(np.full((prior, 2), 0.25), np.full(prior, 2.0), 8, np.dtype("float32"))
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


def test_prior_samples_come_first_then_time_decides():
    late, early = Sample(2.0, 0, 0.1, 0.2, 0.3), Sample(1.0, 1, 0.4, 0.5, 0.6)
    x, y, mask = taken_in([late, early], prior=1).slots()
    np.testing.assert_array_equal(y[:3], np.array([2.0, 0.6, 0.3], np.float32))
    np.testing.assert_array_equal(x[:3], np.array([[0.25, 0.25], [0.4, 0.5], [0.1, 0.2]], np.float32))
    assert mask.tolist() == [True] * 3 + [False] * 5


@given(count=st.integers(0, 5000), room=st.integers(0, 5000))
def test_capacities_are_powers_of_two_with_room(count, room):
    slots = slots_for(count, room)
    assert slots >= max(count, room, 2) and slots & (slots - 1) == 0
    assert slots < 2 * max(count, room, 2)


def test_the_capacity_follows_from_the_count():
    measurements = taken_in([])
    assert measurements.capacity == 8
    for index in range(20):
        measurements.add(Sample(index, 0, 0, 0, 0))
    assert measurements.capacity == len(measurements.slots().y) == 32 and len(measurements) == 20
