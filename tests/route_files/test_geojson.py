import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon, shape

from maipp.errors import InputError
from maipp.route_files import RoutePlan
from maipp.route_files.geojson import geojson_file

GOLDEN = Path(__file__).with_name("golden") / "routes.geojson"


def positions(least):
    return {"type": "array", "items": {"$ref": "#/$defs/position"}, "minItems": least}


def geometry(kind, coordinates):
    members = {"type": {"const": kind}, "coordinates": coordinates, "bbox": {"type": "array"}}
    return {"type": "object", "required": ["type", "coordinates"], "properties": members, "additionalProperties": False}


# RFC 7946, sections 3.1 to 3.3, of what is used here: positions are longitude, latitude; rings have four positions or
# more; features have a geometry and properties, and no members of other GeoJSON objects (section 7.1).
SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "type": "object",
    "required": ["type", "features"],
    "properties": {
        "type": {"const": "FeatureCollection"},
        "features": {"type": "array", "items": {"$ref": "#/$defs/feature"}},
        "crs": False,
        "coordinates": False,
        "geometry": False,
        "properties": False,
    },
    "$defs": {
        "position": {
            "type": "array",
            "prefixItems": [
                {"type": "number", "minimum": -180, "maximum": 180},
                {"type": "number", "minimum": -90, "maximum": 90},
                {"type": "number"},
            ],
            "minItems": 2,
            "maxItems": 3,
        },
        "feature": {
            "type": "object",
            "required": ["type", "geometry", "properties"],
            "properties": {
                "type": {"const": "Feature"},
                "properties": {"type": ["object", "null"]},
                "geometry": {
                    "oneOf": [
                        geometry("Point", {"$ref": "#/$defs/position"}),
                        geometry("LineString", positions(2)),
                        geometry("Polygon", {"type": "array", "items": positions(4)}),
                    ]
                },
                "features": False,
                "coordinates": False,
            },
        },
    },
}


def read(text):
    content = json.loads(text)
    jsonschema.Draft202012Validator(SCHEMA).validate(content)
    return content["features"]


def of_kind(features, kind):
    return [
        (shape(feature["geometry"]), feature["properties"])
        for feature in features
        if feature["properties"]["kind"] == kind
    ]


@given(st.data())
def test_shapely_reads_what_was_planned(any_plan, data):
    plan = any_plan(data)
    features = read(geojson_file(plan))
    routes = of_kind(features, "route")
    assert [about["robot"] for _, about in routes] == [route.name for route in plan.routes]
    for (line, about), route in zip(routes, plan.routes, strict=True):
        np.testing.assert_allclose(np.array(line.coords), route.points, rtol=0, atol=0.51e-7)
        np.testing.assert_allclose(about["times_s"], route.times, rtol=0, atol=0.0051)
        assert about["speed_m_s"] == route.speed and about["length_m"] == about["distances_m"][-1]
    measured = of_kind(features, "measurement")
    planned = np.vstack([route.measurements for route in plan.routes])
    np.testing.assert_allclose(np.reshape([p.coords[0] for p, _ in measured], (-1, 2)), planned, rtol=0, atol=0.51e-7)
    assert {(about["quantity"], about["unit"]) for _, about in measured} <= {(plan.quantity, plan.unit)}


@pytest.mark.parametrize("turned", [False, True])
def test_polygons_are_closed_and_wound_by_the_right_hand_rule(plan, turned):
    if turned:
        no_go = tuple(zone[::-1] for zone in plan.no_go)
        plan = RoutePlan(plan.title, plan.routes, plan.area[::-1], no_go, True)
    features = read(geojson_file(plan))
    ((area, _),), zones = of_kind(features, "area"), of_kind(features, "no-go")
    for polygon, read_back in zip((plan.area, *plan.no_go), (area, *(zone for zone, _ in zones)), strict=True):
        assert isinstance(read_back, Polygon)
        ring = read_back.exterior
        assert ring.is_ccw and ring.coords[0] == ring.coords[-1]
        assert {tuple(point) for point in ring.coords} == {tuple(point) for point in np.round(polygon, 7).tolist()}


def test_seven_decimals_at_most(plan):
    numbers = [json.loads(geojson_file(plan), parse_float=str)]
    found = []
    while numbers:
        item = numbers.pop()
        if isinstance(item, dict):
            numbers += [value for key, value in item.items() if key in ("features", "geometry", "coordinates")]
        elif isinstance(item, list):
            numbers += item
        else:
            found.append(len(item.partition(".")[2]))
    assert max(found) == 7


def test_the_file_is_as_agreed(plan):
    assert geojson_file(plan) == GOLDEN.read_text(encoding="utf-8")


def test_metres_are_refused(plan_in_metres):
    with pytest.raises(InputError, match="RFC 7946"):
        geojson_file(plan_in_metres)


def a_feature(kind, coordinates):
    return {"type": "Feature", "properties": {}, "geometry": {"type": kind, "coordinates": coordinates}}


@pytest.mark.parametrize(
    "broken",
    [
        {},
        {"features": [], "crs": {}},
        {"features": [a_feature("LineString", [[0, 0]])]},
        {"features": [a_feature("Point", [52, 191])]},
        {"features": [a_feature("Polygon", [[[0, 0], [1, 0], [0, 0]]])]},
    ],
)
def test_the_schema_can_say_no(broken):
    with pytest.raises(jsonschema.ValidationError):
        read(json.dumps({"type": "FeatureCollection", **broken}))
