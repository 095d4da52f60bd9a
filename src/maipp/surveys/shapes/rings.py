"""Rings of positions, checked and made into polygons."""

import numpy as np
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from maipp.geo import WGS84, Crs, check_degrees, unwrap
from maipp.records import show
from maipp.surveys.shapes.drawing import Rings, wrong
from maipp.typing import Float

_MOST_VERTICES = 1_000_000


def to_polygon(written: Rings, crs: Crs) -> Polygon:
    """The polygon, its vertices (x, y) or (longitude, latitude) in this system, checked.

    Longitudes come out within 180 degrees of its first vertex, so that an area across the 180th meridian is one piece.
    Raises `InputError` for positions that are none, outside the range of degrees, too few, on one line, and for rings
    that cross themselves, with the place.
    """
    if not written.rings:
        wrong(written.where, "has no ring; give a list of rings, each a list of positions")
    arrays = [_ring(ring, _named(written, index), crs) for index, ring in enumerate(written.rings)]
    if crs == WGS84:
        arrays = [unwrap(ring, float(arrays[0][0, 0])) for ring in arrays]
    polygon = Polygon(arrays[0], arrays[1:])
    if not polygon.is_valid:
        reason, _, place = explain_validity(polygon).partition("[")
        at = f" at ({', '.join(f'{float(c):.10g}' for c in place.rstrip(']').split()[:2])})" if place else ""
        if "self-intersection" in reason.lower():
            problem = f"crosses or touches itself{at}; list its vertices in order around the border"
        else:
            problem = f"not a simple polygon: {reason.strip().lower()}{at}"
        wrong(written.where, problem)
    return polygon


def _ring(ring: object, where: str, crs: Crs) -> Float[np.ndarray, "v 2"]:
    if not isinstance(ring, list) or not ring:
        wrong(where, f"{show(ring)} is not a ring; give a list of positions")
    if len(ring) > _MOST_VERTICES:
        wrong(where, f"has {len(ring)} vertices; simplify it to {_MOST_VERTICES} at most")
    for index, position in enumerate(ring):
        right = isinstance(position, list) and 2 <= len(position) <= 4
        if not right or not all(isinstance(c, int | float) and not isinstance(c, bool) for c in position):
            axes = "[longitude, latitude]" if crs.geographic else "[x, y]"
            wrong(where, f"position {index} is {show(position)}; give {axes}")
        if not all(abs(c) < 1e15 for c in position):  # false for NaN as well
            wrong(where, f"position {index} is {show(position)}; give finite numbers")
    points = np.array([position[:2] for position in ring], np.float64)
    if crs == WGS84:
        check_degrees(points, where)
    distinct = len(np.unique(points, axis=0))
    if distinct < 3:
        wrong(where, f"has {distinct} distinct positions; a polygon needs at least 3")
    centred = points - points.mean(axis=0)
    if np.linalg.matrix_rank(centred / max(float(np.abs(centred).max()), 1e-300)) < 2:
        wrong(where, "its positions lie on one line; give it an area")
    return points


def _named(written: Rings, index: int) -> str:
    return written.where if index == 0 else f"{written.where}: hole {index - 1}"
