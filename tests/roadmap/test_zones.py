"""No-go zones as arrays: borders to stop at, corners to turn at, shortest ways."""

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Polygon

from maipp.roadmap import Obstacles, free_space, zones_of
from maipp.roadmap.zones import CLEARANCE
from maipp.scenario import Scenario
from tests.shared.random_areas import random_area

SQUARE = ((0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75))
HALVES = (
    ((0.25, 0.25), (0.5, 0.25), (0.5, 0.75), (0.25, 0.75)),
    ((0.5, 0.25), (0.75, 0.25), (0.75, 0.75), (0.5, 0.75)),
)
WALL = ((0.45, -0.1), (0.55, -0.1), (0.55, 1.1), (0.45, 1.1))
BOX = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
SEEDS = range(12)


def test_without_obstacles_there_are_no_zones():
    assert zones_of(Scenario()) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_the_free_side_of_every_edge_is_to_its_left(seed):
    scenario = random_area(seed).scenario
    union = Obstacles(scenario.obstacles).union
    edges = free_space(scenario.obstacles, scenario.extent).edges
    along = edges[:, 1] - edges[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1) / length
    middle, near = edges.mean(axis=1), 1e-7
    long = length[:, 0] > 1e-5
    # What is right of an edge is a zone, or the clearance around one.
    inside = shapely.distance(union, shapely.points(middle + near * right)) < CLEARANCE * 2.5
    assert inside[long].all()
    of_zones = shapely.distance(union.boundary, shapely.points(middle)) < 1e-9
    left, of_left = middle - near * right, long & of_zones
    assert not shapely.contains_xy(union, *left[of_left].T).any()
    assert shapely.contains_xy(union, *(middle + near * right)[of_left].T).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_corners_keep_clear_and_ways_are_the_shortest_over_them(seed):
    scenario = random_area(seed).scenario
    free = free_space(scenario.obstacles, scenario.extent)
    obstacles = Obstacles(scenario.obstacles)
    assert (shapely.distance(obstacles.union, shapely.points(free.corners)) > 0.9 * CLEARANCE).all()
    ways = free.corner_lengths_to(free.corners)
    np.testing.assert_allclose(ways, ways.T, atol=1e-9)
    offset = np.linalg.norm(free.corners[:, None] - free.corners, axis=-1)
    assert (ways >= offset - 1e-9).all()
    # No leg between two corners crosses a zone, and none that keeps well clear is missing.
    i, j = np.triu_indices(len(free.corners), 1)
    seen = np.isfinite(free.legs[i, j])
    assert not obstacles.crosses(free.corners[i][seen], free.corners[j][seen]).any()
    legs = np.asarray(shapely.linestrings(np.stack([free.corners[i], free.corners[j]], axis=1)))
    assert (shapely.distance(obstacles.union, legs[~seen]) < 2.5 * CLEARANCE).all()


@pytest.mark.parametrize("obstacles", [(SQUARE,), HALVES])
def test_the_way_around_a_square_is_the_one_by_hand(obstacles):
    scenario = Scenario(obstacles=obstacles, grid=3)
    zones = zones_of(scenario)
    assert zones is not None
    free = free_space(scenario.obstacles, scenario.extent)
    assert len(free.corners) == 4  # the side that two zones share has none
    (way,) = free.corner_lengths_to(np.array([[0.9, 0.5]])).T
    nearest = np.argmin(np.linalg.norm(free.corners - (0.25, 0.25), axis=1))
    assert way[nearest] == pytest.approx(0.5 + np.hypot(0.15, 0.25), abs=5 * CLEARANCE)
    # The grid's middle is in the zone.
    lengths = np.asarray(zones.to_place)[: len(free.corners)]
    assert np.isinf(lengths[:, 4]).all() and np.isfinite(np.delete(lengths, 4, axis=1)).all()


def test_no_way_leads_through_a_wall():
    free = free_space((WALL,), (1.0, 1.0))
    assert len(free.corners) == 0
    assert zones_of(Scenario(obstacles=(WALL, SQUARE))) is not None


def test_a_domain_without_free_space_has_zones_all_the_same():
    zones = zones_of(Scenario(obstacles=(BOX,), grid=3))
    assert zones is not None
    assert np.isinf(zones.to_place).all()


def test_arrays_are_padded_as_told():
    zones = zones_of(Scenario(obstacles=(SQUARE,)), edges=100, corners=40)
    assert zones is not None
    assert zones.borders.begin.shape == (128, 2) and zones.corner_lengths.shape == (64, 64)
    assert (np.asarray(zones.borders.length) > 0).sum() == 8


def test_detail_gives_way_where_there_are_very_many_corners():
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    gear = 0.5 + (0.3 + 0.01 * np.cos(400 * angle))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    free = free_space((tuple(map(tuple, gear.tolist())),), (1.0, 1.0))
    assert 4 <= len(free.corners) <= 256
    wheel = Polygon(gear)
    i, j = np.nonzero(np.isfinite(free.legs))
    assert not any(LineString(free.corners[[a, b]]).crosses(wheel) for a, b in zip(i[:500], j[:500], strict=True))
