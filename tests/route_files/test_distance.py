import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.route_files.distance import distances

LATITUDES, AZIMUTHS = st.floats(-89.0, 89.0), st.floats(0.0, 360.0)


@given(LATITUDES, AZIMUTHS, st.floats(0.0, 1e5))
def test_legs_agree_with_geographiclib_to_the_millimetre(latitude, azimuth, metres):
    geodesic = pytest.importorskip("pyproj").Geod(ellps="WGS84")
    longitude_there, latitude_there, _ = geodesic.fwd(0.0, latitude, azimuth, metres)
    points = np.array([[0.0, latitude], [longitude_there, latitude_there]])
    assert distances(points, geographic=True)[-1] == pytest.approx(metres, abs=1e-3)


@given(LATITUDES, AZIMUTHS)
def test_long_legs_agree_to_the_metre(latitude, azimuth):
    geodesic = pytest.importorskip("pyproj").Geod(ellps="WGS84")
    there = geodesic.fwd(0.0, latitude, azimuth, 1e6)[:2]
    assert distances(np.array([[0.0, latitude], there]), geographic=True)[-1] == pytest.approx(1e6, abs=1.0)


def test_metres_add_up():
    points = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [0.0, 0.0]])
    np.testing.assert_array_equal(distances(points, geographic=False), [0.0, 5.0, 5.0, 10.0])


@pytest.mark.parametrize("geographic", [True, False])
def test_who_stays_travels_nothing(geographic):
    assert distances(np.array([[4.0, 52.0]]), geographic=geographic).tolist() == [0.0]
    assert distances(np.array([[4.0, 90.0]] * 3), geographic=geographic).tolist() == [0.0, 0.0, 0.0]
