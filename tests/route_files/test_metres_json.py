import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.route_files.metres_json import SCHEMA, metres_json_file

GOLDEN = Path(__file__).with_name("golden") / "routes-in-metres.json"


@given(st.data())
def test_it_holds_the_plan(any_plan, data):
    plan = any_plan(data, geographic=False)
    content = json.loads(metres_json_file(plan))
    assert (content["schema"], content["title"], content["unit"]) == (SCHEMA, plan.title, plan.unit)
    np.testing.assert_allclose(content["area"], plan.area, rtol=0, atol=0.51e-3)
    for found, route in zip(content["routes"], plan.routes, strict=True):
        assert (found["robot"], found["speed_m_s"]) == (route.name, route.speed)
        np.testing.assert_allclose(found["points"], route.points, rtol=0, atol=0.51e-3)
        np.testing.assert_allclose(np.reshape(found["measurements"], (-1, 2)), route.measurements, rtol=0, atol=0.51e-3)


def test_nobody_takes_it_for_geojson(plan_in_metres):
    content = json.loads(metres_json_file(plan_in_metres))
    assert "type" not in content and "features" not in content
    assert content["note"].startswith("not GeoJSON: coordinates are metres")


def test_the_file_is_as_agreed(plan_in_metres):
    assert metres_json_file(plan_in_metres) == GOLDEN.read_text(encoding="utf-8")


def test_degrees_are_refused(plan):
    with pytest.raises(InputError, match="write it as GeoJSON"):
        metres_json_file(plan)
