"""Areas from gridded maps: what lies on one side of a level, and what holds values."""

import numpy as np
import pytest
import shapely

from maipp.errors import InputError
from maipp.surveys.raster_area import load_area, raster_polygons
from maipp.surveys.survey import RasterArea

AXIS = np.linspace(0.0, 10.0, 41)
RADIUS = np.hypot(AXIS[None] - 5, AXIS[:, None] - 5)


def area(folder, values, level=0.0, below=True):
    path = folder / "map.npz"
    np.savez(path, depth=values, x=AXIS, y=AXIS)
    source = RasterArea(path, None, level, below, "m.yaml:1: area")
    return shapely.union_all(raster_polygons(source, load_area(source)))


def test_a_round_lake_with_an_island(tmp_path):
    lake = area(tmp_path, np.abs(RADIUS - 2.5) - 1.5)  # a ring from radius 1 to 4
    assert lake.area == pytest.approx(np.pi * (16 - 1), rel=0.01)
    assert not lake.contains(shapely.Point(5, 5)) and lake.contains(shapely.Point(5, 7.5))


def test_below_and_above_make_up_the_map(tmp_path):
    values = RADIUS - 3
    both = [area(tmp_path, values, 0.5, below) for below in (True, False)]
    assert both[0].area + both[1].area == pytest.approx(100) and both[0].intersection(both[1]).area < 1e-6


@pytest.mark.parametrize("level", [None, -1.0])
def test_cells_without_a_value_are_outside(tmp_path, level):
    values = np.where(RADIUS < 3, RADIUS - 5, np.nan)
    lake = area(tmp_path, values, level)
    assert lake.area < np.pi * 9 and lake.area > 0.8 * np.pi * 9
    assert not lake.buffer(1e-9).contains(shapely.Point(5, 8.5))


def test_a_level_that_nothing_reaches_is_told(tmp_path):
    with pytest.raises(InputError, match=r"m.yaml:1: area: no cell lies below -3; the raster has 0 to 7"):
        area(tmp_path, RADIUS, -3.0)
