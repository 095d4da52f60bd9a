"""Positions lead there and back, and lengths are those on the ground."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.geo import METRES, PLANE, WGS84, check_degrees, ground_scale, local_crs, read_crs, transform, unwrap, wrap
from maipp.geo.transform import _transformer

pyproj = pytest.importorskip("pyproj")
GEOD = pyproj.Geod(ellps="WGS84")
degrees = st.tuples(st.floats(-179.9, 179.9), st.floats(-80, 80))
# A place in each: Berlin's north, Manhattan.
PLACES = {
    "EPSG:3857": (13.3, 53.4),
    "EPSG:25833": (13.3, 53.4),
    "EPSG:4314": (13.3, 53.4),
    "EPSG:2263": (-73.97, 40.77),
}


@given(centre=degrees, angle=st.floats(0, 360), distance=st.floats(1, 4e5))
def test_local_lengths_from_the_centre_are_those_on_the_ellipsoid(centre, angle, distance):
    # pyproj's geodesics are Karney's algorithm, not the projection.
    longitude, latitude, _ = GEOD.fwd(centre[0], centre[1], angle, distance)
    there = transform(np.array([longitude, latitude]), WGS84, local_crs(centre))
    assert np.hypot(*there) == pytest.approx(distance, rel=1e-6, abs=1e-3)


@given(centre=degrees, x=st.floats(-5e5, 5e5), y=st.floats(-5e5, 5e5))
def test_local_lengths_far_from_the_centre_are_right_to_a_thousandth_or_two(centre, x, y):
    ends = transform(np.array([[x, y], [x + 700.0, y - 700.0]]), local_crs(centre), WGS84)
    (west, south), (east, north) = ends.tolist()
    # Across the way to the centre, c Earth radii away, it is c / sin(c): 1.0021 in the corners.
    assert GEOD.inv(west, south, east, north)[2] == pytest.approx(np.hypot(700, 700), rel=2.1e-3)


@pytest.mark.parametrize(("code", "place"), PLACES.items())
def test_there_and_back(code, place):
    crs = read_crs(code, "here")
    there = transform(np.array(place), WGS84, crs)
    expected = pyproj.Transformer.from_crs("EPSG:4326", code, always_xy=True).transform(*place)
    np.testing.assert_allclose(there, expected, rtol=1e-12)
    np.testing.assert_allclose(transform(there, crs, WGS84), place, atol=1e-8)


def test_another_datum_is_another_place():
    # The Potsdam datum lies some 120 m east and 170 m north of WGS84 there.
    there = transform(np.array([13.3, 53.4]), read_crs("EPSG:4314", "here"), WGS84)
    assert GEOD.inv(13.3, 53.4, *there.tolist())[2] == pytest.approx(205, abs=20)


@pytest.mark.parametrize(("code", "place"), PLACES.items())
def test_a_unit_is_as_long_as_on_the_ground(code, place):
    crs = read_crs(code, "here")
    x, y = transform(np.array(place), WGS84, crs).tolist()
    scale = ground_scale(crs, (x, y))
    assert scale is not None
    step = 1e-3 if crs.geographic else 100.0
    for axis, move in enumerate(((step, 0.0), (0.0, step))):
        ends = transform(np.array([[x, y], [x + move[0], y + move[1]]]), crs, WGS84)
        assert scale[axis] * step == pytest.approx(GEOD.inv(*ends[0], *ends[1])[2], rel=3e-5)


@given(place=degrees)
def test_a_degree_is_as_long_as_on_the_ellipsoid(place):
    x, y = place
    scale = ground_scale(WGS84, place)
    assert scale is not None
    east = GEOD.inv(x - 5e-4, y, x + 5e-4, y)[2]
    north = GEOD.inv(x, y - 5e-4, x, y + 5e-4)[2]
    assert scale == pytest.approx((east * 1e3, north * 1e3), rel=1e-6)


def test_a_metre_of_web_mercator_is_not_one():
    x, y = transform(np.array([13.3, 53.4]), WGS84, read_crs("EPSG:3857", "here")).tolist()
    scale = ground_scale(read_crs("EPSG:3857", "here"), (x, y))
    assert scale == pytest.approx((0.597, 0.597), abs=0.003)  # cos(53.4 degrees), and the ellipsoid


def test_planes():
    assert ground_scale(METRES, (0.0, 0.0)) == (1.0, 1.0) and ground_scale(PLANE, (0.0, 0.0)) is None
    assert transform(np.array([3.0, 4.0]), PLANE, PLANE).tolist() == [3.0, 4.0]


@pytest.mark.parametrize(
    ("points", "source", "target", "told"),
    [
        ([[1.0, 2.0]], PLANE, WGS84, "it is not known where on Earth they are"),
        ([[1.0, 2.0]], WGS84, METRES, "it is not known where on Earth they are"),
        ([[13.3, 5e9]], WGS84, read_crs("EPSG:3857", "x"), "(13.3, 5000000000) is no place in EPSG:4326 (degrees)"),
    ],
)
def test_what_leads_nowhere_is_told(points, source, target, told):
    with pytest.raises(InputError) as caught:
        transform(np.array(points), source, target, "a.csv")
    assert str(caught.value).startswith(f"a.csv: {told}") and "\n" not in str(caught.value)


def test_degrees_of_a_sphere_are_taken_for_those_of_wgs84():
    sphere = read_crs("+proj=longlat +R=6371229", "model.nc")
    np.testing.assert_allclose(transform(np.array([13.3, 53.4]), sphere, WGS84), [13.3, 53.4], atol=1e-9)


def test_longitudes_are_wrapped():
    assert wrap(np.array([[190.0, 3.0], [-180.0, 4.0], [540.0, 0.0]]))[:, 0].tolist() == [-170.0, -180.0, -180.0]
    assert unwrap(np.array([[-170.0, 3.0], [170.0, 4.0]]), 175.0)[:, 0].tolist() == [190.0, 170.0]


def test_what_is_no_longitude_and_latitude_is_told():
    check_degrees(np.array([[359.0, 90.0]]), "here")
    for point, told in (((53.4, 113.3), "are they swapped?"), ((389_000.0, 5.9e6), "with crs")):
        with pytest.raises(InputError, match="^here: ") as caught:
            check_degrees(np.array([point]), "here")
        assert told in str(caught.value)


def test_without_pyproj_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    _transformer.cache_clear()
    with pytest.raises(InputError, match=r"pip install 'maipp\[geo\]'"):
        transform(np.zeros((1, 2)), WGS84, local_crs((1.0, 2.0)))
    assert ground_scale(WGS84, (4.0, 52.0)) is not None
