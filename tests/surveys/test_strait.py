"""The example of the Strait of Georgia: routes never cross land, in degrees and in metres."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.interpolate import RegularGridInterpolator

from maipp.fields.mixture import evaluation_grid
from maipp.roadmap import Obstacles
from maipp.route_files import write_route_files
from maipp.surveys.expected_mission import expected_mission
from maipp.surveys.raster_area import load_area, raster_polygons
from maipp.surveys.raster_field import raster_field
from maipp.surveys.routes import route_plan
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import load_survey

STRAIT = Path(__file__).parents[2] / "docs" / "examples" / "strait"
SMALL = {"grid": 12, "nodes": 80, "neighbours": 8}


def planned(name, planner="shared-greedy"):
    survey = load_survey(STRAIT / name)
    survey.scenario.update(SMALL)  # type: ignore[attr-defined]
    prepared = prepare(survey, planner=planner)
    return prepared, route_plan(prepared, expected_mission(prepared))


@pytest.fixture(scope="module")
def elevation():
    with np.load(STRAIT / "relief.npz") as file:
        return RegularGridInterpolator((file["latitude"], file["longitude"]), file["elevation"])


def test_routes_in_degrees_stay_on_water(elevation, tmp_path):
    prepared, plan = planned("mission.yaml")
    assert plan.geographic and [route.name for route in plan.routes] == ["heron", "murre", "puffin"]
    for route in plan.routes:
        assert len(route.points) > 3
        # Along straight lines in degrees, as a chart draws them; every 100 m or so.
        dense = shapely.get_coordinates(shapely.segmentize(shapely.linestrings(route.points), 1e-3))
        assert (elevation(dense[:, ::-1]) < 0).all()
        assert (elevation(route.measurements[:, ::-1]) < 0).all()
    names = {path.name for path in write_route_files(plan, tmp_path)}
    assert {"heron.plan", "routes.gpx", "routes.geojson", "waypoints.csv"} <= names
    assert prepared.frame.inverted and prepared.fit is not None and prepared.fit.samples > 40
    assert prepared.scenario.threshold == pytest.approx((150 + prepared.frame.mean) / prepared.frame.std)


def test_routes_in_metres_keep_the_clearance_from_land():
    _, plan = planned("mission-metres.yaml")
    content = json.loads((STRAIT / "land-metres.geojson").read_text(encoding="utf-8"))
    land = shapely.union_all([shapely.from_geojson(json.dumps(each["geometry"])) for each in content["features"]])
    assert not plan.geographic
    for route in plan.routes:
        assert shapely.distance(shapely.linestrings(route.points), land) > 500


def test_both_files_describe_one_place():
    degrees, metres = (prepare(load_survey(STRAIT / name)) for name in ("mission.yaml", "mission-metres.yaml"))
    # The window in metres is a little smaller, and UTM's scale differs by 0.04 %.
    assert metres.region.area == pytest.approx(degrees.region.area, rel=0.06)
    assert metres.scenario.length_scale == pytest.approx(degrees.scenario.length_scale, rel=0.05)


def test_land_is_where_the_relief_is_above_water(elevation):
    survey = load_survey(STRAIT / "mission.yaml")
    water = shapely.union_all(raster_polygons(survey.area, load_area(survey.area)))  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    points = rng.uniform([-124.97, 48.87], [-122.96, 49.97], (3000, 2))
    # Contours cut a cell along straight lines, bilinear interpolation along a curve: near the coast they differ.
    sure = np.abs(elevation(points[:, ::-1])) > 60
    wet = shapely.contains_xy(water, points[:, 0], points[:, 1])
    assert (wet == (elevation(points[:, ::-1]) < 0))[sure].mean() > 0.99
    assert 0.3 < wet.mean() < 0.6


def test_only_water_is_evaluated(elevation):
    prepared = prepare(load_survey(STRAIT / "mission.yaml"), planner="shared-greedy")
    grid = np.asarray(evaluation_grid(prepared.scenario.grid, prepared.scenario.extent), np.float64)
    user = prepared.frame.to_user(grid[Obstacles(prepared.scenario.obstacles).free(grid)])
    heights = elevation(user[:, ::-1])
    # In a cell whose corners alternate, contour and bilinear surface differ by some metres; peaks are 2,000 m high.
    assert len(user) > 150 and heights.max() < 20 and (heights < 0).mean() > 0.98


def test_the_relief_rehearses_in_the_survey_s_unit(elevation):
    prepared = prepare(load_survey(STRAIT / "mission.yaml"), planner="shared-greedy")
    field = raster_field(prepared, STRAIT / "relief.npz")
    domain = np.random.default_rng(1).random((200, 2)) * prepared.frame.domain * 0.98 + 0.01
    user = prepared.frame.to_user(domain)
    inside = (user > [-124.97, 48.87]).all(axis=1) & (user < [-122.96, 49.97]).all(axis=1)
    import jax.numpy as jnp

    found = prepared.frame.to_user_values(np.asarray(field(jnp.asarray(domain[inside], jnp.float32)), np.float64))
    assert np.abs(found - elevation(user[inside][:, ::-1])).mean() < 12  # of some 2,000 m from peak to trough
