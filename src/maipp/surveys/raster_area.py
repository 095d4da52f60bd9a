"""An area from a gridded map: where its values lie on one side of a level, such as water below 0 m."""

from typing import Any

import numpy as np
import shapely
from contourpy import FillType, contour_generator
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.fields.raster import RasterData, load_raster
from maipp.surveys.mission_file import RasterArea


def load_area(source: RasterArea) -> RasterData:
    """The map of an area. Raises `InputError` where it cannot be read, or does not say where it lies."""
    return placed(load_raster(source.raster, value=source.value, gaps="nearest", crs=source.crs, at=source.at))


def placed(data: RasterData) -> RasterData:
    """The map. Raises `InputError` where it has no coordinates, so that nobody knows where it lies."""
    if not data.placed:
        raise InputError(f"{data.source}: has no coordinates; save it with those of its columns and rows (x and y)")
    return data


def raster_polygons(source: RasterArea, data: RasterData) -> list[Polygon]:
    """The polygons between the level's contour lines, in the raster's coordinates, holes (islands) included.

    Between grid points the map is taken as linear; squares with a corner that holds no value are left out. Longitudes
    may be 0 to 360. Raises `InputError` where the raster has no cell on the asked side.
    """
    values = data.values if source.below else -data.values
    if source.level is None:
        values, level = np.zeros_like(values), 1.0
    else:
        level = source.level if source.below else -source.level
    held = np.ones(values.shape, bool) if data.missing is None else ~data.missing
    if source.level is not None and not (values < level)[held].any():
        low, high = float(data.values.min()), float(data.values.max())
        side = "below" if source.below else "above"
        raise InputError(f"{source.where}: no cell lies {side} {source.level:g}; the raster has {low:g} to {high:g}")
    lowest = min(float(values.min()), level) - 1.0
    held_values = np.ma.masked_array(values, ~held)
    contours = contour_generator(data.x, data.y, held_values, corner_mask=True, fill_type=FillType.OuterOffset)
    filled: Any = contours.filled(lowest, level)  # two lists, in this way of filling
    each_rings = [np.split(points, begins[1:-1]) for points, begins in zip(*filled, strict=True)]
    # A polygon's outer ring comes first; a ring of fewer than three corners has no area.
    polygons = [
        Polygon(outer, [hole for hole in holes if len(hole) >= 4]) for outer, *holes in each_rings if len(outer) >= 4
    ]
    region = shapely.union_all([each if each.is_valid else each.buffer(0) for each in polygons])
    parts = [part for part in shapely.get_parts(region) if isinstance(part, Polygon) and part.area > 0]
    if not parts:
        raise InputError(f"{source.where}: no four cells beside each other are in the area; give another level")
    return parts
