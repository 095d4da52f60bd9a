"""Areas from gridded maps: what lies on one side of a level, and what holds values."""

import numpy as np
import pytest
import shapely

from maipp.errors import InputError
from maipp.surveys.mission_file import RasterArea
from maipp.surveys.raster_area import load_area, raster_polygons

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


def test_islands_lakes_on_them_and_touching_corners(tmp_path):
    """Rings within rings, and a saddle at the border: every grid point is where its value belongs."""
    values = np.full((40, 40), -1.0)
    for level, ring in enumerate(range(4, 20, 4)):
        values[ring:-ring, ring:-ring] = 1.0 if level % 2 == 0 else -1.0
    values[0, 0] = values[1, 1] = 2.0  # a saddle beside
    np.savez(tmp_path / "rings.npz", values=values, x=np.arange(40.0), y=np.arange(40.0))
    parts = {}
    for below in (True, False):
        source = RasterArea(tmp_path / "rings.npz", None, 0.0, below, "m.yaml:1: area")
        parts[below] = raster_polygons(source, load_area(source))
        assert all(part.is_valid for part in parts[below])
    wet, dry = (shapely.union_all(parts[below]) for below in (True, False))
    assert wet.area + dry.area == pytest.approx(39**2) and wet.intersection(dry).area == pytest.approx(0, abs=1e-9)
    for y, x in np.argwhere(np.ones(values.shape, bool)):
        assert (wet if values[y, x] < 0 else dry).distance(shapely.Point(x, y)) < 1e-9
    assert sorted(len(part.interiors) for part in parts[True])[-2:] == [1, 1]


def test_a_map_that_does_not_say_where_it_lies_is_refused(tmp_path):
    np.save(tmp_path / "map.npy", RADIUS)
    with pytest.raises(InputError, match="map.npy: has no coordinates; save it with"):
        load_area(RasterArea(tmp_path / "map.npy", None, 0.0, True, "m.yaml:1: area"))
