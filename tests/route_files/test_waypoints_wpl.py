"""Waypoint files, as an independent reader takes them."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavwp import MAVWPLoader

from maipp.errors import InputError
from maipp.route_files.vehicle_settings import VehicleSettings
from maipp.route_files.waypoints_wpl import wpl_file


def loaded(text, folder) -> list[Any]:
    (folder / "a.waypoints").write_text(text)
    loader = MAVWPLoader()
    loader.load(str(folder / "a.waypoints"))
    return [loader.wp(index) for index in range(loader.count())]


@given(st.data())
def test_the_waypoints_are_the_route(any_plan, tmp_path_factory, data):
    plan = any_plan(data)
    for route in plan.routes:
        home, speed, *rest = loaded(wpl_file(plan, route), tmp_path_factory.getbasetemp())
        assert (home.command, home.frame, home.current) == (16, 0, 1)
        assert (speed.command, speed.param1, speed.param3) == (178, 1, -1)
        assert speed.param2 == pytest.approx(route.speed, abs=1e-8)
        assert all((each.command, each.frame, each.autocontinue) == (16, 3, 1) for each in rest)
        places = np.array([(each.y, each.x) for each in (home, *rest)])
        np.testing.assert_allclose(places, [route.points[0], *route.points], rtol=0, atol=0.51e-7)


def test_a_copter_takes_off_first(plan, tmp_path):
    found = loaded(wpl_file(plan, plan.routes[0], VehicleSettings("copter", altitude=20.0, autopilot="px4")), tmp_path)
    assert [each.command for each in found] == [16, 22, 178, 16, 16, 16] and found[-1].z == 20


def test_a_plan_in_metres_is_refused(plan_in_metres):
    with pytest.raises(InputError, match="needs longitudes and latitudes"):
        wpl_file(plan_in_metres, plan_in_metres.routes[0])
