"""Of all that a file draws what may be entered."""

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import translate

from maipp.errors import InputError
from maipp.surveys.shapes import Named, water_of

LAKE, ISLAND, POND = (shapely.box(-half, -half, half, half) for half in (10, 4, 1))


def water(*drawn):
    found = water_of("a", [Named(*each) for each in drawn])
    return shapely.union_all(found.area).area, len(found.zones), found.notes


def test_polygons_within_polygons_are_islands_and_water_again():
    area, zones, notes = water((POND, "pond", None), (LAKE, "lake", None), (ISLAND, "", None))
    assert area == 400 - 64 + 4 and zones == 0
    assert notes == ("a: a polygon lies wholly inside 'lake'; taken as an island",)


def test_a_shore_that_is_crossed_by_a_hair_is_inside():
    island = translate(ISLAND, 6.004)
    assert water((LAKE, "lake", None), (island, "rock", None))[0] == pytest.approx(400 - 64, abs=0.1)


def test_names_make_zones():
    area, zones, notes = water((LAKE, "lake", None), (ISLAND, "no-go", True))
    assert area == 400 and zones == 1 and notes == ("a: 'no-go' is taken as a no-go zone, as its name says",)


def test_where_all_are_named_none_is():
    area, zones, notes = water((LAKE, "Island lake", True), (ISLAND, "island", True))
    assert area == 400 - 64 and zones == 0 and "every polygon is named" in notes[0]
    with pytest.raises(InputError, match="draws only what must not be entered"):
        water((ISLAND, "", True))


def test_what_overlaps_or_is_there_twice_is_told():
    area, _, notes = water((LAKE, "lake", None), (translate(LAKE, 5), "bay", None), (LAKE, "copy", None))
    assert area == 500 and any("'copy' is there twice" in note for note in notes)
    assert any("'bay' overlaps 'lake'" in note for note in notes)


boxes = st.lists(st.tuples(*[st.integers(0, 12)] * 2, *[st.integers(1, 12)] * 2), min_size=1, max_size=6)


@given(boxes=boxes, order=st.randoms())
def test_the_order_in_the_file_changes_nothing(boxes, order):
    drawn = [(shapely.box(x, y, x + w, y + h), f"{i}", None) for i, (x, y, w, h) in enumerate(boxes)]
    area = water(*drawn)[0]
    order.shuffle(drawn)
    # Two of one size that overlap in all but a hair may swap, which these cannot.
    assert water(*drawn)[0] == pytest.approx(area)


@given(st.lists(st.integers(1, 40), min_size=1, max_size=8, unique=True))
def test_nested_rings_are_water_in_turns(halves):
    """Against the even-odd rule."""
    drawn = [(shapely.box(-half, -half, half, half), "", None) for half in halves]
    expected = sum((-1) ** i * (2 * half) ** 2 for i, half in enumerate(sorted(halves, reverse=True)))
    assert water(*drawn)[0] == pytest.approx(expected)
