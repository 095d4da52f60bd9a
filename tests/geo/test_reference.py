"""References lead there and back."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.geo import METRES, WGS84, GeoReference

METRIC = GeoReference.of_area((5e5, 5.4e6, 502_000.0, 5_400_500.0)).standardised(12.0, 4.0)
shares = st.tuples(st.floats(0, 1), st.floats(0, 1))
degrees = st.tuples(st.floats(-179.9, 179.9), st.floats(-80, 80))


@given(centre=degrees, size=st.tuples(st.floats(1, 5e5), st.floats(1, 5e5)), share=shares)
def test_degrees_lead_to_the_domain_and_back(centre, size, share):
    pytest.importorskip("pyproj")
    there = GeoReference.of_area((-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2), centre)
    point = np.array(share) * there.domain
    user = there.to_user(point)
    assert -180 <= user[0] < 180 and -90 <= user[1] <= 90
    assert there.to_domain(user) == pytest.approx(point, abs=1e-7)
    assert max(there.domain) == 1.0 and there.geographic and there.crs == WGS84


def test_metres_stay_metres():
    assert METRIC.to_domain(np.array([[5e5, 5.4e6], [502000.0, 5400500.0]])).tolist() == [[0, 0], [1, 0.25]]
    assert METRIC.to_user(np.array([0.5, 0.25])).tolist() == [501000.0, 5400500.0]
    assert METRIC.metres_per_unit == 2000 and METRIC.domain == (1.0, 0.25) and METRIC.length_scale == 2000
    assert METRIC.crs == METRES and not METRIC.geographic and METRIC.for_pictures is METRIC


@pytest.mark.parametrize("below", [False, True])
def test_values_are_standardised_so_that_high_ones_matter(below):
    there = METRIC.standardised(12.0, 4.0, below=below)
    assert there.to_domain_values(16.0) == (-1.0 if below else 1.0)
    assert there.to_user_values(there.to_domain_values(np.array([3.0, 99.0]))).tolist() == [3.0, 99.0]
    assert there.to_user_std(0.5) == 2.0 and there.std == 4.0 and there.inverted == below


def test_the_domain_is_its_own():
    own = GeoReference.of_domain((1.0, 0.5))
    points = np.array([[0.1, 0.3], [1.0, 0.5]])
    assert (own.to_user(points) == points).all() and (own.to_domain(points) == points).all()
    assert own.to_user_values(0.7) == 0.7 and own.metres_per_unit is None and own.aspect == 1.0


def test_a_stretched_file_has_no_length_along_any_path():
    stretched = GeoReference((0.0, 0.0), (10.0, 40.0), (1.0, 1.0))
    assert stretched.length_scale is None and stretched.aspect == 0.25


def test_pictures_in_degrees_are_near_enough():
    pytest.importorskip("pyproj")
    there = GeoReference.of_area((-74500.0, -63000.0, 74500.0, 63000.0), (-123.9, 49.4))
    corner = np.array([1.0, there.domain[1]])
    off = there.to_plane(there.for_pictures.to_user(corner)) - there.to_plane(there.to_user(corner))
    assert np.hypot(*off) < 0.012 * 149_000
    assert there.for_pictures.user is None and there.for_pictures.geographic


def test_a_picture_across_the_180th_meridian_has_a_width():
    pytest.importorskip("pyproj")
    there = GeoReference.of_area((-5000.0, -5000.0, 5000.0, 5000.0), (180.0, -17.0))
    assert 0 < there.for_pictures.size[0] < 0.2


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("depth (m)", "depth", "m"),
        ("uptake (mg/(L h))", "uptake", "mg/(L h)"),
        ("depth (chart) (m)", "depth (chart)", "m"),
        ("salt", "salt", None),
        ("(m)", "(m)", None),
    ],
)
def test_the_unit_stands_behind_the_name(name, quantity, unit):
    there = GeoReference((0.0, 0.0), (1.0, 1.0), (1.0, 1.0), value_name=name)
    assert (there.quantity, there.unit) == (quantity, unit)


def test_references_are_keys_and_json():
    assert len({METRIC, METRIC.standardised(12.0, 4.0), METRIC.standardised(0.0, 4.0)}) == 2
    written = json.loads(json.dumps(METRIC.to_dict()))
    assert written["plane"] == {"crs": None, "geographic": False, "metres": 1.0} and written["user"] is None
    assert written["size"] == [2000.0, 500.0] and written["metres_per_unit"] == 2000.0
