"""Fences in the vertices that an autopilot stores."""

import json

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon

from maipp.route_files import Route, RoutePlan
from maipp.route_files.fences import MOST, fence_of
from maipp.route_files.qgc_plan import plan_file


def rough(radius, count, seed, centre=(4.2, 51.9)):
    """A coast of many vertices around a place, degrees."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    reach = radius * (1 + 0.05 * np.sin(7 * angle) + 0.01 * rng.normal(size=count))
    return np.stack([centre[0] + reach * np.cos(angle) / 0.617, centre[1] + reach * np.sin(angle)], axis=-1)


def coast(offset=0.004):
    """A lake of some 1,100 m with an island, and a route that keeps clear of both."""
    angle = np.linspace(0.2, 5.5, 20)
    points = np.stack([4.2 + offset * np.cos(angle) / 0.617, 51.9 + offset * np.sin(angle)], axis=-1)
    route = Route("a", points, np.arange(20.0), 1.0, home=points[-1])
    return RoutePlan("", (route,), rough(0.01, 300, 1), (rough(0.002, 120, 2),), True)


@pytest.mark.parametrize("autopilot", MOST)
def test_it_fits_inside_the_area_and_around_the_zones(autopilot):
    plan, most = coast(), MOST[autopilot]
    fence = fence_of(plan, most)
    assert len(fence.area) + sum(map(len, fence.zones)) <= most
    area, zones = Polygon(plan.area), shapely.union_all([Polygon(zone) for zone in plan.no_go])
    assert area.contains(Polygon(fence.area))
    assert shapely.union_all([Polygon(zone) for zone in fence.zones]).contains(zones)
    assert fence.note is not None and f"of {420} vertices to fit the autopilot" in fence.note
    free = area.difference(zones).area
    kept = Polygon(fence.area).difference(shapely.union_all([Polygon(zone) for zone in fence.zones])).area
    assert 0.9 < kept / free < 1 and f"{1 - kept / free:.1%}" in fence.note


def test_a_fence_that_fits_is_the_plan_s_own():
    plan = coast()
    fence = fence_of(plan, 420)
    assert fence.area is plan.area and fence.zones == plan.no_go and fence.note is None


def test_no_route_is_fenced_out():
    plan = coast(0.0088)  # close to the shore
    fence = fence_of(plan, 12)
    assert fence.note is not None and "too near to it for fewer" in fence.note
    assert Polygon(fence.area).contains(shapely.linestrings(plan.routes[0].points))


def test_home_is_a_rally_point_inside_the_fence():
    plan = coast()
    content = json.loads(plan_file(plan, plan.routes[0], fence=fence_of(plan, 70)))
    ((latitude, longitude, altitude),) = content["rallyPoints"]["points"]
    assert (longitude, latitude) == pytest.approx(plan.routes[0].points[-1].tolist(), abs=1e-7) and altitude == 0
    assert Polygon(fence_of(plan, 70).area).contains(shapely.Point(longitude, latitude))
    assert "null" not in plan_file(plan, plan.routes[0])
