"""Waypoints that an autopilot accepts: inside of its fence by a margin."""

from collections.abc import Callable

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.ops import nearest_points

from maipp.errors import InputError
from maipp.route_files.fences import Fence
from maipp.typing import Float

Points = Float[np.ndarray, "n 2"]


class Inside:
    """What lies inside of a fence by a margin; all in metres of a plane."""

    def __init__(self, fence: Fence, margin: float, to_plane: Callable[[np.ndarray], np.ndarray]) -> None:
        """`to_plane` gives metres of the fence's coordinates. Raises `InputError` where the margin leaves nothing."""
        area = Polygon(to_plane(fence.area))
        zones = shapely.union_all([Polygon(to_plane(zone)) for zone in fence.zones])
        self.free = area.difference(zones).buffer(-margin)
        if self.free.is_empty:
            raise InputError(f"--with margin={margin:g}: nothing of the area is left; give less")
        shapely.prepare(self.free)

    def moved(self, points: Points) -> tuple[Points, Float[np.ndarray, " n"]]:
        """The points, those outside moved to the nearest place inside; and how far each was moved."""
        kept = points.copy()
        for number, point in enumerate(points):
            if not shapely.intersects_xy(self.free, *point):
                kept[number] = shapely.get_coordinates(nearest_points(self.free, Point(point))[0])[0]
        return kept, np.hypot(*(kept - points).T)
