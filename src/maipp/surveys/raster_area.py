"""An area from a gridded map: where its values lie on one side of a level, such as water below 0 m."""

import functools

import numpy as np
import shapely
from matplotlib.figure import Figure
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from maipp.errors import InputError
from maipp.fields.raster import load_raster
from maipp.surveys.geojson import check_degrees
from maipp.surveys.survey import RasterArea


def raster_polygons(source: RasterArea, *, geographic: bool) -> list[Polygon]:
    """The polygons between the level's contour lines, in the raster's coordinates, holes (islands) included.

    Between grid points the map is taken as linear. Longitudes may be 0 to 360. Raises `InputError` where the raster
    cannot be read, is not in degrees though it should be, or has no cell on the asked side.
    """
    data = load_raster(source.raster, value=source.value)
    if geographic:
        check_degrees(np.array([[data.x[0], data.y[0]], [data.x[-1], data.y[-1]]]), str(source.raster))
    values = data.values if source.below else -data.values
    level = source.level if source.below else -source.level
    if not (values < level).any():
        low, high = float(data.values.min()), float(data.values.max())
        side = "below" if source.below else "above"
        raise InputError(f"{source.where}: no cell lies {side} {source.level:g}; the raster has {low:g} to {high:g}")
    lowest = min(float(values.min()), level) - 1.0
    axes = Figure().add_subplot()
    (path,) = axes.contourf(data.x, data.y, values, levels=[lowest, level]).get_paths()
    outlines = [np.asarray(ring) for ring in path.to_polygons(closed_only=True)]
    rings = [Polygon(ring) for ring in outlines if len(ring) >= 4]
    # Outer rings and holes come without saying which is which: what lies in an even number of rings is outside.
    valid = [ring if ring.is_valid else ring.buffer(0) for ring in rings]
    region = functools.reduce(_exclusive, sorted(valid, key=lambda ring: -ring.area))
    parts = [part for part in shapely.get_parts(region) if isinstance(part, Polygon) and part.area > 0]
    if not parts:
        raise InputError(f"{source.where}: the cells on that side of {source.level:g} have no area; give another level")
    return parts


def _exclusive(region: BaseGeometry, ring: BaseGeometry) -> BaseGeometry:
    return shapely.symmetric_difference(region, ring)
