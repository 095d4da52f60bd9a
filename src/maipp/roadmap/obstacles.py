"""No-go polygons: which points are free, which straight legs cross one."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.validation import explain_validity

from maipp.errors import InputError
from maipp.typing import Bool, Float

Vertices = Sequence[Sequence[float]] | np.ndarray  # (v, 2) positions, domain units, in order around the border


class Obstacles:
    """The no-go polygons of a domain, validated; their borders may be touched, their interiors not entered.

    `polygons`: one sequence of (x, y) vertices each, domain units, in either orientation, closing vertex
    optional, no holes. They may overlap; two that share a side leave no gap between them. Raises InputError
    naming the index of the first one that is not a simple polygon with an area.
    """

    polygons: tuple[Polygon, ...]
    union: BaseGeometry  # the forbidden region as one geometry; empty without polygons

    def __init__(self, polygons: Sequence[Vertices] = ()) -> None:
        self.polygons = tuple(_polygon(index, vertices) for index, vertices in enumerate(polygons))
        self.union = shapely.union_all(self.polygons) if self.polygons else Polygon()
        # Parts of the union, not the polygons: their interior includes the sides that two neighbours share.
        self._parts = shapely.get_parts(self.union)
        self._tree = shapely.STRtree(self._parts)
        shapely.prepare(self.union)
        shapely.prepare(self._parts)

    def __len__(self) -> int:
        return len(self.polygons)

    def free(self, points: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Whether each point lies outside every obstacle's interior (a point on a border is free)."""
        return ~shapely.contains_xy(self.union, points[:, 0], points[:, 1])

    def crosses(self, start: Float[np.ndarray, "n 2"], end: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Whether each leg from `start` to `end` enters an obstacle's interior; touching does not count."""
        if not self.polygons:
            return np.zeros(len(start), dtype=bool)
        blocked = ~self.free(start)  # decides legs of length zero, on which GEOS versions differ
        legs = np.asarray(shapely.linestrings(np.stack([start, end], axis=1)))
        leg, part = self._tree.query(legs)
        meets = shapely.intersects(self._parts[part], legs[leg])
        leg, part = leg[meets], part[meets]
        # Two geometries that meet without touching share interior points.
        blocked[leg[~shapely.touches(self._parts[part], legs[leg])]] = True
        return blocked


def _polygon(index: int, vertices: Vertices) -> Polygon:
    """The shapely polygon of one obstacle; raises InputError saying what is wrong with it."""
    where = f"obstacle {index}"
    try:
        array = np.asarray(vertices, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: its vertices must be pairs of numbers (x, y)") from error
    if array.size and (array.ndim != 2 or array.shape[1] != 2):
        raise InputError(f"{where}: its vertices must be pairs (x, y), got an array of shape {array.shape}")
    if not np.isfinite(array).all():
        vertex = int(np.argwhere(~np.isfinite(array))[0, 0])
        raise InputError(f"{where}: vertex {vertex} is {tuple(array[vertex].tolist())}; it must be finite")
    distinct = len(np.unique(array, axis=0)) if array.size else 0
    if distinct < 3:
        raise InputError(f"{where}: it has {distinct} distinct vertices; a polygon needs at least 3")
    polygon = Polygon(array)
    # Zero area first: a flat polygon is invalid too, but "self-crossing" would send its author the wrong way.
    if np.linalg.matrix_rank(array - array.mean(axis=0)) < 2:
        raise InputError(f"{where}: its vertices lie on one line, so its area is zero; give it an area")
    if not polygon.is_valid:
        raise InputError(
            f"{where}: not a simple polygon ({explain_validity(polygon)}); list its vertices in order around "
            "the border, without crossing or touching itself"
        )
    return polygon
