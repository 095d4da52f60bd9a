import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LinearRing

from maipp.errors import InputError
from maipp.route_files.qgc_plan import plan_file
from maipp.route_files.vehicle_settings import VehicleSettings

GOLDEN = Path(__file__).with_name("golden") / "Nord_Süd 1.plan"

LATITUDE = {"type": "number", "minimum": -90, "maximum": 90}
LONGITUDE = {"type": "number", "minimum": -180, "maximum": 180}


def an_object(required, **optional):
    return {"type": "object", "required": list(required), "properties": {**required, **optional}}


def a_tuple(*items):
    return {"type": "array", "prefixItems": list(items), "minItems": len(items), "maxItems": len(items)}


# QGroundControl developer guide, "Plan File Format", and what its loader asks for besides: fence and rally points must
# be there, params are seven, the first four numbers or null.
PLACE = a_tuple(LATITUDE, LONGITUDE)
PARAM = {"type": ["number", "null"]}
ITEM = an_object(
    {
        "type": {"const": "SimpleItem"},
        "autoContinue": {"type": "boolean"},
        "command": {"type": "integer", "minimum": 0},
        "doJumpId": {"type": "integer", "minimum": 1},
        "frame": {"type": "integer", "minimum": 0},
        "params": {**a_tuple(PARAM, PARAM, PARAM, PARAM, LATITUDE, LONGITUDE, {"type": "number"})},
    },
    AMSLAltAboveTerrain={"type": ["number", "null"]},
    Altitude={"type": "number"},
    AltitudeMode={"enum": [0, 1, 2, 3, 4]},
)
SCHEMA = an_object(
    {
        "fileType": {"const": "Plan"},
        "version": {"const": 1},
        "groundStation": {"type": "string"},
        "mission": an_object(
            {
                "version": {"const": 2},
                "firmwareType": {"enum": [3, 12]},
                "vehicleType": {"enum": [2, 10, 11]},
                "globalPlanAltitudeMode": {"enum": [0, 1, 2, 3, 4]},
                "cruiseSpeed": {"type": "integer", "exclusiveMinimum": 0},  # Mission Planner's reader wants it whole
                "hoverSpeed": {"type": "integer", "exclusiveMinimum": 0},
                "plannedHomePosition": a_tuple(LATITUDE, LONGITUDE, {"type": "number"}),
                "items": {"type": "array", "minItems": 1, "items": ITEM},
            }
        ),
        "geoFence": an_object(
            {
                "version": {"const": 2},
                "circles": {"type": "array"},
                "polygons": {
                    "type": "array",
                    "items": an_object(
                        {
                            "version": {"const": 1},
                            "inclusion": {"type": "boolean"},
                            "polygon": {"type": "array", "minItems": 3, "items": PLACE},
                        }
                    ),
                },
            }
        ),
        "rallyPoints": an_object({"version": {"const": 2}, "points": {"type": "array"}}),
    }
)
WAYPOINT, TAKEOFF, SPEED = 16, 22, 178  # MAV_CMD


def read(text):
    content = json.loads(text)
    jsonschema.Draft202012Validator(SCHEMA).validate(content)
    return content


def commands(content):
    return [item["command"] for item in content["mission"]["items"]]


@given(st.data())
def test_the_waypoints_are_the_route(any_plan, data):
    plan = any_plan(data)
    for route in plan.routes:
        content = read(plan_file(plan, route))
        mission = content["mission"]
        speed, *waypoints = mission["items"]
        assert commands(content) == [SPEED] + [WAYPOINT] * len(route.points)
        assert speed["params"] == [1, route.speed, -1, 0, 0, 0, 0] and speed["frame"] == 2
        places = np.array([item["params"][4:6] for item in waypoints])[:, ::-1]
        np.testing.assert_allclose(places, route.points, rtol=0, atol=0.51e-7)
        np.testing.assert_allclose(mission["plannedHomePosition"][1::-1], route.points[0], rtol=0, atol=0.51e-7)
        assert [item["doJumpId"] for item in mission["items"]] == list(range(1, len(route.points) + 2))
        assert mission["cruiseSpeed"] == mission["hoverSpeed"] == max(1, round(route.speed))


def test_the_fence_keeps_inside_the_area_and_out_of_the_zones(plan):
    polygons = read(plan_file(plan, plan.routes[0]))["geoFence"]["polygons"]
    assert [polygon["inclusion"] for polygon in polygons] == [True, False]
    for polygon, ring in zip(polygons, (plan.area, *plan.no_go), strict=True):
        vertices = [(longitude, latitude) for latitude, longitude in polygon["polygon"]]
        assert {*vertices} == {tuple(point) for point in ring.tolist()} and len(vertices) == len(ring)
        assert not LinearRing(vertices).is_ccw  # clockwise, as the guide says


def test_a_copter_takes_off_before_its_speed_is_set(plan):
    content = read(plan_file(plan, plan.routes[0], VehicleSettings("copter", "px4", altitude=30.0)))
    assert commands(content) == [TAKEOFF, SPEED, WAYPOINT, WAYPOINT, WAYPOINT]
    mission = content["mission"]
    assert (mission["firmwareType"], mission["vehicleType"]) == (12, 2)
    placed = [item for item in mission["items"] if item["command"] in (TAKEOFF, WAYPOINT)]
    assert {(item["frame"], item["params"][6], item["Altitude"]) for item in placed} == {(3, 30.0, 30.0)}


@pytest.mark.parametrize(("kind", "mav_type"), [("boat", 11), ("rover", 10)])
def test_what_floats_or_drives_needs_no_altitude(plan, kind, mav_type):
    content = read(plan_file(plan, plan.routes[0], VehicleSettings(kind, fence=False)))
    assert (content["mission"]["firmwareType"], content["mission"]["vehicleType"]) == (3, mav_type)
    assert content["geoFence"]["polygons"] == []
    assert content["mission"]["items"][1]["params"][6] == 0.0


def test_hundreds_of_vertices_are_hundreds_of_waypoints(plan):
    from maipp.route_files import Route, RoutePlan

    turns = np.linspace(0, 20, 700)
    points = np.stack([4.2 + 0.001 * turns * np.cos(turns), 51.9 + 0.001 * turns * np.sin(turns)], axis=-1)
    route = Route("spiral", points, turns, 1.0)
    content = read(plan_file(RoutePlan("", (route,), plan.area, (), True), route))
    assert len(content["mission"]["items"]) == 701


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"kind": "plane"}, "vehicle 'plane' is not known; give boat, rover, copter"),
        ({"autopilot": "dji"}, "autopilot 'dji' is not known; give ardupilot, px4"),
        ({"kind": "copter"}, "needs an altitude"),
        ({"kind": "copter", "altitude": 0.0}, "needs an altitude"),
        ({"altitude": float("nan")}, "altitude is nan"),
    ],
)
def test_vehicles_that_do_not_exist_are_told(options, told):
    with pytest.raises(InputError, match=told):
        VehicleSettings(**options)


def test_the_file_is_as_agreed(plan):
    assert plan_file(plan, plan.routes[0]) == GOLDEN.read_text(encoding="utf-8")


def test_metres_are_refused(plan_in_metres):
    with pytest.raises(InputError, match="needs longitudes and latitudes"):
        plan_file(plan_in_metres, plan_in_metres.routes[0])


@pytest.mark.parametrize("change", [("version", 2), ("geoFence", {}), ("groundStation", None)])
def test_the_schema_can_say_no(plan, change):
    content = json.loads(plan_file(plan, plan.routes[0]))
    content[change[0]] = change[1]
    with pytest.raises(jsonschema.ValidationError):
        read(json.dumps(content))
