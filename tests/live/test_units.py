import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.live.units import Units

PLACE = GeoReference.of_area((100.0, 200.0, 500.0, 500.0)).standardised(8.0, 4.0, below=True)
METRES = dataclasses.replace(PLACE, value_name="chlorophyll (ug/L)")
LAKE = Units(METRES.domain, METRES, epoch=1.7e9, seconds_per_time=400.0)
OWN = Units((1.0, 0.5))


@given(x=st.floats(-300, 900), y=st.floats(-100, 900))
def test_positions_come_back(x, y):
    point = LAKE.position("position", (x, y))
    assert LAKE.points_out(np.array([point]))[0] == pytest.approx([x, y], abs=1e-4)


@given(value=st.floats(-100, 100), time=st.floats(0, 1e6))
def test_values_and_times_come_back(value, time):
    assert LAKE.values_out(np.array([LAKE.value("value", value)]))[0] == pytest.approx(value, rel=1e-6, abs=1e-5)
    assert LAKE.time_out(LAKE.time("time", 1.7e9 + time)) == pytest.approx(1.7e9 + time, abs=1e-3)


def test_by_hand():
    assert LAKE.position("position", (300.0, 200.0)) == (0.5, 0.0)
    assert LAKE.value("value", 4.0) == 1.0  # low values matter
    assert LAKE.length("travelled", 100.0) == 0.25 and LAKE.length_out(0.25) == 100.0
    assert LAKE.time("time", 1.7e9 + 800) == 2.0
    assert LAKE.speed_out(1.0) == 1.0  # 400 m in 400 s
    assert LAKE.speed("speed", 2.0) == 2.0 and LAKE.threshold("threshold", 6.0) == 0.5
    ring = ((100.0, 200.0), (300.0, 200.0), (300.0, 300.0))
    assert LAKE.polygon("polygon", ring) == ((0.0, 0.0), (0.5, 0.0), (0.5, 0.25))
    assert LAKE.std_out(np.array([0.5])) == [2.0]
    assert LAKE.covariance_out(np.array([0.25, 0.0, 1.0])) == [40_000.0, 0.0, 160_000.0]
    assert LAKE.names == {"position": "m", "length": "m", "value": "ug/L", "time": "s"}


@given(number=st.floats(-1, 2, width=32))
def test_domain_units_keep_every_bit_of_single_precision(number):
    ((x, _),) = OWN.points_out(np.array([[number, 0.0]]))
    assert np.float32(x) == np.float32(number)


@pytest.mark.parametrize(
    ("units", "ask", "told"),
    [
        (OWN, lambda u: u.position("position", (2.1, 0.0)), "position: [2.1, 0.0] is far outside of the survey's area"),
        (OWN, lambda u: u.position("position", (0.0, 1.6)), "position: "),
        (OWN, lambda u: u.value("value", 1e30), "value: 1e+30 is more than 10000 standard deviations from the mean"),
        (OWN, lambda u: u.time("time", 1.7e9), "time: 1700000000 is not between the epoch (0) and 3 years later; for"),
        (LAKE, lambda u: u.time("time", 5.0), "time: 5 is not between the epoch (1700000000) and 3 years later"),
        (OWN, lambda u: u.length("budget", 1e9), "budget: 1e+09 is more than 10000 times the area's longest side"),
    ],
)
def test_what_is_too_far_off_is_told(units, ask, told):
    with pytest.raises(InputError) as error:
        ask(units)
    assert str(error.value).startswith(told) and "\n" not in str(error.value)


def test_degrees():
    pytest.importorskip("pyproj")
    frame = GeoReference.of_area((-5000.0, -4000.0, 5000.0, 4000.0), (-123.5, 49.0))
    units = Units(frame.domain, frame)
    assert units.position("position", (-123.5, 49.0)) == pytest.approx((0.5, 0.4))
    assert units.points_out(np.array([[0.5, 0.4]]))[0] == pytest.approx([-123.5, 49.0], abs=1e-8)
    for point, told in (
        ((49.0, -123.5), "is not [longitude, latitude] in degrees"),
        ((-123.5, 50.0), "far outside of the survey's area (longitude comes first)"),
    ):
        with pytest.raises(InputError) as error:
            units.position("position", point)
        assert told in str(error.value)


def test_edges_of_a_zone_in_degrees_are_straight_there_and_not_in_the_plane():
    """At 60 degrees a parallel 80 km long bulges by d^2 tan(60) / 8R = 217 m, each of 20 pieces by 1/400 of that."""
    pytest.importorskip("pyproj")
    place = GeoReference.of_area((-50_000.0, -50_000.0, 50_000.0, 50_000.0), (5.0, 60.0))
    west, east = (5.0 - 40_000 / 55_800, 5.0 + 40_000 / 55_800)  # metres in a degree of longitude there
    ring = ((west, 60.0), (east, 60.0), (east, 60.2), (west, 60.2))
    found = np.array(Units(place.domain, place).polygon("polygon", ring))
    south = place.to_domain(np.array([[5.0, 60.0], [west, 60.0]]))
    low = found[np.argmin(np.hypot(*(found - south[0]).T))]
    assert low == pytest.approx(south[0], abs=1e-5) and south[1, 1] - south[0, 1] > 1e-3
