"""Obstacles: validation of polygons, free points, blocked legs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon

from maipp.errors import InputError
from maipp.roadmap import Obstacles

SQUARE = [(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)]
LEFT = [(0.25, 0.25), (0.5, 0.25), (0.5, 0.75), (0.25, 0.75)]
RIGHT = [(0.5, 0.25), (0.75, 0.25), (0.75, 0.75), (0.5, 0.75)]


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([], "obstacle 1: it has 0 distinct vertices; a polygon needs at least 3"),
        ([(0.0, 0.0), (1.0, 0.0)], "obstacle 1: it has 2 distinct vertices"),
        ([(0.0, 0.0), (1.0, 0.0), (0.0, 0.0), (1.0, 0.0)], "obstacle 1: it has 2 distinct vertices"),
        ([(0.0, 0.0), (0.1, 0.3), (0.2, 0.6)], "obstacle 1: its vertices lie on one line"),
        ([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)], "obstacle 1: not a simple polygon .*in order"),
        (
            [(0.0, 0.0), (float("nan"), 1.0), (1.0, 0.0)],
            r"obstacle 1: vertex 1 is \(nan, 1.0\); it must be finite",
        ),
        ([(0.0, 0.0), (float("inf"), 1.0), (1.0, 0.0)], "obstacle 1: vertex 1 .*finite"),
        ([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)], r"obstacle 1: .*pairs \(x, y\).*\(3, 3\)"),
        ([(0.0, 0.0), (1.0,), (0.0, 1.0)], r"obstacle 1: its vertices must be pairs of numbers"),
    ],
)
def test_a_bad_polygon_is_named_with_what_would_be_right(vertices, message):
    with pytest.raises(InputError, match=message):
        Obstacles([SQUARE, vertices])


def test_orientation_and_closing_vertex_do_not_matter():
    for vertices in (SQUARE, SQUARE[::-1], [*SQUARE, SQUARE[0]], np.array(SQUARE)):
        assert Obstacles([vertices]).union.area == 0.25


def test_no_obstacles_block_nothing():
    points = np.random.default_rng(0).random((5, 2))
    obstacles = Obstacles()
    assert len(obstacles) == 0
    assert obstacles.free(points).all()
    assert not obstacles.crosses(points, points[::-1]).any()


def test_border_is_free_and_interior_is_not():
    points = np.array([[0.25, 0.25], [0.5, 0.25], [0.5, 0.75], [0.5, 0.5], [0.1, 0.1]])
    assert Obstacles([SQUARE]).free(points).tolist() == [True, True, True, False, True]


@pytest.mark.parametrize(
    ("start", "end", "blocked"),
    [
        ((0.0, 0.5), (1.0, 0.5), True),  # straight through
        ((0.3, 0.3), (0.4, 0.4), True),  # wholly inside
        ((0.0, 0.5), (0.5, 0.5), True),  # ends inside
        ((0.25, 0.5), (0.75, 0.5), True),  # from border to border through the interior
        ((0.0, 0.25), (1.0, 0.25), False),  # along a side and on
        ((0.25, 0.25), (0.75, 0.25), False),  # exactly a side
        ((0.0, 0.5), (0.5, 0.0), False),  # through one corner only
        ((0.0, 0.5), (0.25, 0.5), False),  # up to the border
        ((0.0, 0.0), (0.2, 0.9), False),  # past it
        ((0.5, 0.5), (0.5, 0.5), True),  # no length, inside
        ((0.25, 0.5), (0.25, 0.5), False),  # no length, on the border
    ],
)
def test_a_leg_is_blocked_where_it_enters_the_interior(start, end, blocked):
    obstacles = Obstacles([SQUARE])
    for p, q in ((start, end), (end, start)):
        assert obstacles.crosses(np.array([p]), np.array([q])).tolist() == [blocked]


def test_no_leg_slips_between_obstacles_that_share_a_side():
    obstacles = Obstacles([LEFT, RIGHT])
    assert obstacles.crosses(np.array([[0.5, 0.0]]), np.array([[0.5, 1.0]])).all()
    assert not obstacles.free(np.array([[0.5, 0.5]])).any()


def _star(seed: int) -> np.ndarray:
    """A random star-shaped, so simple, polygon."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(7) + rng.uniform(-0.4, 0.4, 7)) / 7
    radius = rng.uniform(0.05, 0.35, 7)
    return rng.uniform(0.2, 0.8, 2) + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_random_legs_and_points_agree_with_one_by_one_geometry(seed):
    polygons = [Polygon(_star(seed)), Polygon(_star(seed + 1))]
    obstacles = Obstacles([np.asarray(p.exterior.coords) for p in polygons])
    start, end = np.random.default_rng(seed).random((2, 50, 2))
    legs = [LineString([p, q]) for p, q in zip(start, end, strict=True)]
    inside_length = [max(leg.intersection(p).length for p in polygons) for leg in legs]
    assert obstacles.crosses(start, end).tolist() == [length > 1e-12 for length in inside_length]
    assert obstacles.free(start).tolist() == [not any(p.contains(Point(x)) for p in polygons) for x in start]
