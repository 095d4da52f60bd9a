"""The complement covers what is not free, in polygons that a scenario takes."""

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from maipp.roadmap import Obstacles
from maipp.surveys.complement import complement, without_holes

circles = st.lists(st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9), st.floats(0.02, 0.2)), min_size=1, max_size=6)


@given(circles=circles)
def test_free_and_complement_make_up_the_box(circles):
    free = shapely.union_all([Point(x, y).buffer(r, quad_segs=4) for x, y, r in circles])
    parts = complement(free, (1.0, 1.0))
    assert all(not part.interiors for part in parts)
    covered = Obstacles([np.asarray(part.exterior.coords)[:-1] for part in parts]).union
    box = shapely.box(0, 0, 1, 1)
    assert covered.intersection(free).area < 1e-9
    assert box.difference(covered).difference(free).area < 1e-9
    # Corners and sides of the box, where evaluation points lie, are not taken for free.
    border = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.3]], float)
    inside = shapely.intersects_xy(free, border[:, 0], border[:, 1])
    assert not (Obstacles([np.asarray(part.exterior.coords)[:-1] for part in parts]).free(border) & ~inside).any()


@given(circles=circles, x=st.floats(0, 1), y=st.floats(0, 1))
def test_no_leg_slips_through_a_cut(circles, x, y):
    free = shapely.union_all([Point(a, b).buffer(r, quad_segs=4) for a, b, r in circles])
    obstacles = Obstacles([np.asarray(part.exterior.coords)[:-1] for part in complement(free, (1.0, 1.0))])
    # From one part of the free region to another, straight through what is between them.
    parts = shapely.get_parts(free)
    if len(parts) > 1:
        ends = [shapely.get_coordinates(part.representative_point()) for part in parts[:2]]
        assert obstacles.crosses(*ends)[0]
        # Along a cut as well: through the middle of a hole, up and down.
        west, _, east, _ = parts[0].bounds
        middle = (west + east) / 2
        assert obstacles.crosses(np.array([[middle, -0.0]]), np.array([[middle, 1.0]]))[0]


def test_nothing_is_left_of_a_box_that_is_free():
    assert complement(shapely.box(0, 0, 1, 0.5), (1.0, 0.5)) == []


def test_a_hole_too_small_to_cut_is_filled():
    speck = Polygon([(0.5, 0.5), (0.5 + 1e-8, 0.5), (0.5, 0.5 + 1e-8)])
    (part,) = without_holes(Polygon(shapely.box(0, 0, 1, 1).exterior, [speck.exterior]))
    assert part.area == 1 and not part.interiors
