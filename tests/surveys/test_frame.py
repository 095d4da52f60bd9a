"""Frames lead there and back, and lengths are metres on the ground."""

import dataclasses
import sys

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.surveys import frame as frame_module
from maipp.surveys.frame import Frame, project, unproject, wrap

METRIC = Frame(False, (0.0, 0.0), (5e5, 5.4e6), (2000.0, 500.0), 12.0, 4.0, False, "salt", "g/L")
shares = st.tuples(st.floats(0, 1), st.floats(0, 1))
degrees = st.tuples(st.floats(-179.9, 179.9), st.floats(-80, 80))


@given(centre=degrees, size=st.tuples(st.floats(1, 5e5), st.floats(1, 5e5)), share=shares)
def test_degrees_lead_to_the_domain_and_back(centre, size, share):
    frame = Frame(True, centre, (-size[0] / 2, -size[1] / 2), size)
    point = np.array(share) * frame.extent
    user = frame.to_user(point)
    assert -180 <= user[0] < 180 and -90 <= user[1] <= 90
    assert frame.to_domain(user) == pytest.approx(point, abs=1e-7)
    assert max(frame.extent) == 1.0


@given(centre=degrees, angle=st.floats(0, 360), distance=st.floats(1, 4e5))
def test_lengths_from_the_centre_are_those_on_the_ellipsoid(centre, angle, distance):
    # pyproj's geodesics are Karney's algorithm, not the projection that the frame uses.
    longitude, latitude, _ = pyproj.Geod(ellps="WGS84").fwd(centre[0], centre[1], angle, distance)
    assert np.hypot(*project(centre, np.array([longitude, latitude]))) == pytest.approx(distance, rel=1e-6, abs=1e-3)


@given(centre=degrees, x=st.floats(-5e5, 5e5), y=st.floats(-5e5, 5e5))
def test_lengths_far_from_the_centre_are_right_to_a_thousandth_or_two(centre, x, y):
    ends = unproject(centre, np.array([[x, y], [x + 700.0, y - 700.0]]))
    (west, south), (east, north) = ends.tolist()
    (_, _, length) = pyproj.Geod(ellps="WGS84").inv(west, south, east, north)
    # Across the way to the centre, c Earth radii away, it is c / sin(c): 1.0021 in the corners.
    assert length == pytest.approx(np.hypot(700, 700), rel=2.1e-3)


def test_metres_stay_metres():
    assert METRIC.to_domain(np.array([[5e5, 5.4e6], [502000.0, 5400500.0]])).tolist() == [[0, 0], [1, 0.25]]
    assert METRIC.to_user(np.array([0.5, 0.25])).tolist() == [501000.0, 5400500.0]
    assert METRIC.metres_per_unit == 2000 and METRIC.extent == (1.0, 0.25)


@pytest.mark.parametrize("below", [False, True])
def test_values_are_standardised_so_that_high_ones_matter(below):
    frame = dataclasses.replace(METRIC, below=below)
    assert frame.to_domain_values(16.0) == (-1.0 if below else 1.0)
    assert frame.to_user_values(frame.to_domain_values(np.array([3.0, 99.0]))).tolist() == [3.0, 99.0]
    assert frame.to_user_std(0.5) == 2.0


def test_longitudes_are_wrapped():
    assert wrap(np.array([[190.0, 3.0], [-180.0, 4.0], [540.0, 0.0]]))[:, 0].tolist() == [-170.0, -180.0, -180.0]


def test_frames_are_keys():
    assert len({METRIC, dataclasses.replace(METRIC), dataclasses.replace(METRIC, mean=1.0)}) == 2


def test_without_pyproj_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    frame_module._projection.cache_clear()
    with pytest.raises(InputError, match=r"pip install 'maipp\[geo\]'"):
        project((1.0, 2.0), np.zeros((1, 2)))
