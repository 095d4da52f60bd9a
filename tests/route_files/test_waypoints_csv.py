import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.route_files.distance import distances
from maipp.route_files.waypoints_csv import waypoints_csv_file

GOLDEN = Path(__file__).with_name("golden")


@pytest.mark.parametrize("geographic", [True, False])
@given(st.data())
def test_rows_are_the_vertices(any_plan, geographic, data):
    plan = any_plan(data, geographic)
    header, *rows = csv.reader(io.StringIO(waypoints_csv_file(plan), newline=""), strict=True)
    assert header == [
        "robot",
        "order",
        *(("longitude", "latitude") if geographic else ("x_m", "y_m")),
        "time_s",
        "distance_m",
    ]
    found = iter(rows)
    for route in plan.routes:
        travelled = distances(route.points, geographic=geographic)
        for order, (point, time, metres) in enumerate(zip(route.points, route.times, travelled, strict=True)):
            name, number, *numbers = next(found)
            assert (name, int(number)) == (route.name, order)
            *place, seconds, distance = map(float, numbers)
            np.testing.assert_allclose(place, point, rtol=1e-15, atol=0.51e-7 if geographic else 0.51e-3)
            np.testing.assert_allclose((seconds, distance), (time, metres), rtol=1e-12, atol=0.0051)
    assert next(found, None) is None


def test_the_file_is_as_agreed(plan, plan_in_metres):
    assert waypoints_csv_file(plan) == (GOLDEN / "waypoints.csv").read_text(encoding="utf-8")
    assert waypoints_csv_file(plan_in_metres) == (GOLDEN / "waypoints-in-metres.csv").read_text(encoding="utf-8")
