"""Routes keep to a region inside the area, clear of zones, in one piece, whatever the area looks like."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, Point, Polygon

from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.surveys.area import MOST_VERTICES, PlaceNames, Start, as_region, check_size, operating_area

BOX = shapely.box(0, 0, 1000, 800)
NOTHING = MultiPolygon()
NAMES = PlaceNames(GeoReference.of_area((0.0, 0.0, 1.0, 1.0)))  # plain metres


def start(x, y, name="boat"):
    return Start((float(x), float(y)), "m.yaml:3: robots[0].start", name)


def space(area, no_go, *starts, clearance=0.0):
    return operating_area(area, no_go, list(starts), float(clearance), "m.yaml:1: area", NAMES)


@st.composite
def stars(draw, most=1000.0):
    """A concave polygon around (500, 500)."""
    count = draw(st.integers(5, 14))
    radii = draw(st.lists(st.floats(150, most / 2), min_size=count, max_size=count))
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return Polygon(np.stack([500 + radii * np.cos(angle), 500 + radii * np.sin(angle)], axis=-1))


zones = st.lists(st.tuples(st.floats(0, 1000), st.floats(0, 1000), st.floats(5, 200), st.floats(5, 200)), max_size=6)


shares = st.tuples(st.floats(0, 1), st.floats(0, 1))


@given(area=stars(), no_go=zones, share=shares, clearance=st.sampled_from([0, 15]))
def test_the_region_keeps_clear_and_the_start_is_in_it(area, no_go, share, clearance):
    no_go = as_region([shapely.box(x, y, x + w, y + h) for x, y, w, h in no_go])
    x, y = 150 + 700 * np.array(share)
    true = area.difference(no_go)
    try:
        found = space(area, no_go, start(x, y), clearance=clearance)
    except InputError as error:
        assert "\n" not in str(error) and str(error).startswith("m.yaml")
        # Refused for a reason only: no room around the start.
        assert not true.buffer(-(clearance + 12)).contains(Point(x, y))
        return
    assert isinstance(found.region, Polygon) and found.region.is_valid
    assert found.margin > clearance
    # Everywhere within the margin of the region is the true area: a float32 rounding is far less.
    assert true.buffer(1e-6).covers(found.region.buffer(0.99 * found.margin, quad_segs=8))
    assert found.region.covers(Point(found.starts[0]))
    assert shapely.get_num_coordinates(found.region) <= MOST_VERTICES
    assert Point(x, y).distance(Point(found.starts[0])) < 2.5 * (clearance + 12) + 6


def test_a_plain_box_stays_as_it_is():
    found = space(BOX, NOTHING, start(0, 0))
    assert found.region.equals(BOX) and found.margin == 0 and found.warnings == ()
    assert (found.starts > 0).all() and (found.starts < 0.01).all()


@pytest.mark.parametrize("x", [0, -2, 3])
def test_a_start_on_or_near_the_edge_is_moved_inside(x):
    found = space(Polygon([(0, 0), (1000, 0), (0, 1000)]), NOTHING, start(x, 400), clearance=10)
    assert found.starts[0, 0] > 10
    assert len(found.warnings) == 1 and found.warnings[0].startswith("boat: the start is moved")


@pytest.mark.parametrize(
    ("area", "no_go", "starts", "clearance", "problem"),
    [
        (BOX, NOTHING, [start(-50, 10)], 0, "m.yaml:3: robots[0].start: (-50.0, 10.0) lies 50 m outside the area"),
        (
            BOX,
            shapely.box(100, 100, 300, 300),
            [start(200, 200)],
            0,
            "(200.0, 200.0) lies 100 m deep inside a no-go",
        ),
        (BOX, shapely.box(-9, -9, 1009, 809), [start(1, 1)], 0, "m.yaml:1: area: the no-go zones cover all"),
        (BOX, NOTHING, [start(1, 1)], 500, "nothing of the area keeps 500 m clear"),
        (
            BOX,
            shapely.box(490, -9, 510, 900),
            [start(100, 100), start(900, 100, "other")],
            0,
            "other starts in a part of the area (389",
        ),
        (
            as_region([shapely.box(0, 0, 1000, 300), shapely.box(990, 300, 1000, 800)]),
            NOTHING,
            [start(995, 700)],
            20,
            "boat has no room there",
        ),
    ],
)
def test_what_makes_a_survey_impossible_is_one_line(area, no_go, starts, clearance, problem):
    with pytest.raises(InputError) as error:
        space(area, no_go, *starts, clearance=clearance)
    assert problem in str(error.value) and "\n" not in str(error.value)


def test_a_part_that_cannot_be_reached_is_told_and_left_out():
    found = space(BOX, shapely.box(490, -9, 510, 900), start(100, 100))
    assert found.region.bounds[2] < 490
    (warning,) = found.warnings
    assert "a part of the area of 389" in warning and "cannot be reached" in warning


def test_a_passage_closes_when_the_clearance_leaves_no_room():
    walls = as_region([shapely.box(480, 0, 520, 380), shapely.box(480, 420, 520, 800)])
    assert space(BOX, walls, start(100, 100)).region.bounds[2] > 900
    assert space(BOX, walls, start(100, 100), clearance=20).region.bounds[2] < 480


def test_swapped_coordinates_are_noticed():
    with pytest.raises(InputError, match="with its two numbers swapped it lies inside"):
        operating_area(shapely.box(0, 5000, 1000, 6000), NOTHING, [start(5500, 500)], 0.0, "area", NAMES)


def test_a_coast_of_many_vertices_is_simplified():
    angle = np.linspace(0, 2 * np.pi, 5000, endpoint=False)
    radius = 400 + 20 * np.sin(97 * angle) + 6 * np.sin(411 * angle)
    coast = Polygon(np.stack([500 + radius * np.cos(angle), 500 + radius * np.sin(angle)], axis=-1))
    found = space(coast, NOTHING, start(500, 500))
    assert shapely.get_num_coordinates(found.region) <= MOST_VERTICES
    assert coast.covers(found.region) and found.region.area > 0.85 * coast.area


@pytest.mark.parametrize(("size", "problem"), [(0.2, "0.2 m across"), (2e6, "2000 km across")])
def test_areas_are_of_a_size_that_robots_survey(size, problem):
    with pytest.raises(InputError, match=problem):
        check_size((0.0, 0.0, size, 0.1), "area")
