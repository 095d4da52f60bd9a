"""Polygons as people write them, and one line for each way to write them wrong."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.geo import METRES, WGS84
from maipp.surveys.shapes import Rings, polygons_in, to_polygon
from maipp.surveys.shapes.geojson import load_geojson

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
HOLE = [[1, 1], [2, 1], [2, 2], [1, 2], [1, 1]]


def polygon(*rings, geographic=False):
    return to_polygon(Rings("area", list(rings)), WGS84 if geographic else METRES)


@pytest.mark.parametrize(
    "content",
    [
        {"type": "Polygon", "coordinates": [SQUARE, HOLE]},
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [SQUARE, HOLE]}},
        {"type": "MultiPolygon", "coordinates": [[SQUARE, HOLE]]},
        {
            "type": "FeatureCollection",
            "features": [{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [SQUARE, HOLE]}}],
        },
        {"type": "GeometryCollection", "geometries": [{"type": "Polygon", "coordinates": [SQUARE, HOLE]}]},
    ],
)
def test_every_form_gives_the_polygon_with_its_hole(content, tmp_path):
    path = tmp_path / "a.geojson"
    path.write_text("\ufeff" + json.dumps(content), encoding="utf-8")
    (found,) = [to_polygon(rings, METRES) for rings in load_geojson(path).polygons]
    assert found.area == 15 and len(found.interiors) == 1


def test_points_and_lines_beside_the_polygons_are_told():
    line = {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}
    features = [{"type": "Feature", "geometry": {"type": "Point", "coordinates": [1, 2]}}] * 2
    features += [{"type": "Feature", "geometry": each} for each in (line, {"type": "Polygon", "coordinates": [SQUARE]})]
    drawing = polygons_in({"type": "FeatureCollection", "features": features}, "a.geojson")
    assert len(drawing.polygons) == 1
    assert drawing.notes == ("a.geojson: beside its polygons 2 points, 1 line, left out",)


@pytest.mark.parametrize(
    ("properties", "closed"),
    [
        ({"name": "lake"}, None),
        ({"name": "Reeds (no-go)"}, True),
        ({"Name": "North", "Type": "exclusion"}, True),
        ({"kind": "no-go", "number": 1}, True),  # as routes.geojson has it
        ({"kind": "area", "name": "Island sea"}, False),
        ({"name": 7}, None),
        (None, None),
    ],
)
def test_properties_say_what_a_polygon_is(properties, closed):
    feature = {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [SQUARE]}}
    (rings,) = polygons_in(feature, "a").polygons
    assert rings.closed is closed


def test_heights_and_open_rings_are_taken():
    assert polygon([[0, 0, 7], [4, 0, 7], [4, 4, 7]]).area == 8


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ([1, 2], "is not GeoJSON"),
        ({"type": "Point", "coordinates": [1, 2]}, "holds no polygon, only 1 point; give a Polygon"),
        ({"type": "FeatureCollection", "features": []}, "holds no polygon"),
        (
            {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": None}]},
            "holds no polygon, only 1 feature without a geometry",
        ),
        ({"type": "FeatureCollection"}, "no list 'features'"),
        ({"type": "MultiPolygon", "coordinates": [3]}, "coordinates[0]: 3 is not a list of rings"),
        ({"type": "Topology"}, "has the type 'Topology'"),
        ({}, "has the type None"),
    ],
)
def test_what_is_no_polygon_is_told_with_its_place(content, problem):
    with pytest.raises(InputError) as error:
        polygons_in(content, "a.geojson")
    assert str(error.value).startswith("a.geojson") and problem in str(error.value)


@pytest.mark.parametrize(
    ("rings", "problem"),
    [
        ([], "area: has no ring"),
        ([[]], "[] is not a ring"),
        ([[[0, 0], [1, 1]]], "has 2 distinct positions; a polygon needs at least 3"),
        ([[[0, 0], [1, 1], [2, 2]]], "lie on one line"),
        ([[[0, 0], [1e7, 1e7], [2e7, 2e7]]], "lie on one line"),
        ([[[0, 0], [2, 2], [2, 0], [0, 2]]], "crosses or touches itself at (1, 1)"),
        ([SQUARE, [[3, 3], [5, 3], [5, 5], [3, 5]]], "area: "),
        ([[[0, 0], [1, float("nan")], [2, 2]]], "position 1 is [1, nan]; give finite numbers"),
        ([[[0, 0], [1], [2, 2]]], "position 1 is [1]; give [x, y]"),
        ([[[0, 0], ["1", 2], [2, 2]]], "position 1 is ['1', 2]; give [x, y]"),
        ([SQUARE, [[1, 1], [2, 2]]], "area: hole 0: has 2 distinct"),
    ],
)
def test_what_is_wrong_with_a_ring_is_told(rings, problem):
    with pytest.raises(InputError) as error:
        polygon(*rings)
    assert problem in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("ring", "problem"),
    [
        ([[49.3, -123.2], [49.4, -123.2], [49.4, -123.1]], "are they swapped?"),
        ([[5e5, 5.4e6], [5.1e5, 5.4e6], [5.1e5, 5.5e6]], "say what they are with crs"),
        ([[-200, 3], [4, 5], [6, 8]], "is no longitude and latitude"),
    ],
)
def test_what_is_no_longitude_and_latitude_is_told_with_the_likely_reason(ring, problem):
    with pytest.raises(InputError) as error:
        polygon(ring, geographic=True)
    assert problem in str(error.value)


def test_an_area_across_the_180th_meridian_is_one_piece():
    for ring in ([[179.9, 0], [-179.9, 0], [-179.9, 0.1], [179.9, 0.1]], [[179.9, 0], [180.1, 0], [180.1, 0.1]]):
        assert polygon(ring, geographic=True).bounds[2] == pytest.approx(180.1)


@pytest.mark.parametrize("text", ["", "{", '{"type": "Polygon"', "[" * 100_000, '{"type": 1' + "0" * 6000 + "}"])
def test_files_that_are_no_json_are_told(text, tmp_path):
    path = tmp_path / "a.geojson"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="a.geojson"):
        load_geojson(path)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["Polygon", "Feature", "x"]),
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.dictionaries(st.sampled_from(["type", "coordinates", "geometry", "features"]), inner, max_size=4)
    ),
    max_leaves=20,
)


@given(content=json_values, geographic=st.booleans())
def test_any_json_gives_polygons_or_one_line(content, geographic):
    try:
        polygons = [to_polygon(rings, WGS84 if geographic else METRES) for rings in polygons_in(content, "a").polygons]
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert polygons and all(each.is_valid and each.area > 0 for each in polygons)


positions = st.lists(st.floats(allow_nan=True, width=32) | st.integers(), min_size=1, max_size=3)


@given(ring=st.lists(positions, min_size=1, max_size=7), geographic=st.booleans())
def test_any_ring_gives_a_polygon_or_one_line(ring, geographic):
    try:
        found = polygon(ring, geographic=geographic)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert found.is_valid and found.area > 0 and np.isfinite(found.bounds).all()
