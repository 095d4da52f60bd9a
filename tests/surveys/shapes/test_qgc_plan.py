"""QGroundControl's plans: fences and survey items as areas and zones, the planned home as start."""

import json

import numpy as np
import pytest
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.geo import WGS84, local_crs, transform
from maipp.surveys.shapes import load_drawing, to_polygon, water_of
from maipp.surveys.shapes.water import Named

# Latitude first, as plans have it.
LAKE = [[53.4, 13.3], [53.4, 13.33], [53.412, 13.33], [53.412, 13.3]]
REEDS = [[53.404, 13.312], [53.407, 13.312], [53.407, 13.318]]


def plan(polygons=(), circles=(), items=(), home=(53.401, 13.301, 0)):
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"version": 2, "polygons": list(polygons), "circles": list(circles)},
        "mission": {"version": 2, "items": list(items), "plannedHomePosition": home and list(home)},
        "rallyPoints": {"version": 2, "points": []},
    }


def fence(polygon, inclusion):
    return {"inclusion": inclusion, "polygon": polygon, "version": 1}


def circle(inclusion, radius=200):
    return {"inclusion": inclusion, "circle": {"center": [53.406, 13.32], "radius": radius}, "version": 1}


SURVEY = {"type": "ComplexItem", "complexItemType": "survey", "polygon": LAKE, "TransectStyleComplexItem": {}}


def load(folder, content):
    (folder / "a.plan").write_text(json.dumps(content))
    return load_drawing(folder / "a.plan")


def test_fences_are_area_and_zones_and_the_home_is_told(tmp_path):
    drawing = load(tmp_path, plan([fence(REEDS, False), fence(LAKE, True)], [circle(False)], [SURVEY]))
    assert [each.closed for each in drawing.polygons] == [True, False, True]
    assert drawing.home == (13.301, 53.401) and "survey items are left out" in drawing.notes[0]
    named = [Named(to_polygon(each, WGS84), each.name, each.closed) for each in drawing.polygons]
    water = water_of("a.plan", named)
    assert [each.bounds for each in water.area] == [(13.3, 53.4, 13.33, 53.412)] and len(water.zones) == 2


def test_without_an_inclusion_fence_the_survey_is_the_area(tmp_path):
    drawing = load(tmp_path, plan([fence(REEDS, False)], items=[{"type": "SimpleItem"}, SURVEY]))
    assert [each.closed for each in drawing.polygons] == [True, False]
    assert to_polygon(drawing.polygons[1], WGS84).area == pytest.approx(0.03 * 0.012)


def test_fences_of_the_first_version(tmp_path):
    content = plan(home=None)
    content["geoFence"] = {"version": 1, "polygon": LAKE, "circles": []}
    drawing = load(tmp_path, content)
    assert len(drawing.polygons) == 1 and drawing.home is None


@pytest.mark.parametrize("inclusion", [True, False])
def test_a_circle_errs_to_the_safe_side(inclusion, tmp_path):
    (rings,) = load(tmp_path, plan(circles=[circle(inclusion)])).polygons
    metres = transform(np.array(rings.rings[0]), WGS84, local_crs((13.32, 53.406)))
    area, true = Polygon(metres).area, np.pi * 200**2
    assert (area < true) == inclusion and area == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ([], "is no QGroundControl plan"),
        ({"fileType": "Fence"}, "is no QGroundControl plan"),
        (plan(), "holds no polygon; give a plan with an inclusion fence"),
        (plan([fence(3, True)]), "geoFence: polygons[0]: 3 is no list"),
        (plan([fence([[91, 0], [0, 0], [1, 1]], True)]), "is no [latitude, longitude] in degrees"),
        (plan([fence([["a", 0]], True)]), "is no position; give [latitude, longitude]"),
        (plan(circles=[circle(True, -1)]), "the radius is -1; give metres above 0"),
        (plan(circles=[3]), "circles[0]: 3 is no mapping"),
        ({"fileType": "Plan", "geoFence": {"polygons": 3}}, "polygons is 3; it must be a list"),
    ],
)
def test_what_is_wrong_is_one_line(content, problem, tmp_path):
    with pytest.raises(InputError) as error:
        load(tmp_path, content)
    assert problem in str(error.value) and "\n" not in str(error.value)
