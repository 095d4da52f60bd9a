"""What of a box is not free, as the simple polygons without holes that a scenario holds."""

import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

# How far the complement reaches beyond the box, shares of its longest side. A point on the border of an obstacle counts
# as free: those of the evaluation grid on the border of the box must lie within.
_BEYOND = 0.05


def complement(free: BaseGeometry, size: tuple[float, float]) -> list[Polygon]:
    """What of the box [0, width] x [0, height] and a rim around it is not free, cut into polygons without holes.

    Empty where all of the box is free.
    """
    box, least = shapely.box(0.0, 0.0, *size), 1e-12 * size[0] * size[1]
    if shapely.difference(box, free).area <= least:
        return []
    rim = _BEYOND * max(size)
    rest = shapely.difference(shapely.box(-rim, -rim, size[0] + rim, size[1] + rim), free)
    # Splinters of no width, which rounding leaves: nothing could pass through them anyway.
    return [part for part in without_holes(rest) if part.area > least]


def without_holes(region: BaseGeometry) -> list[Polygon]:
    """The region cut into simple polygons without holes.

    A polygon is halved through the middle of its largest hole until none is left; the halves overlap by a hair, so that
    rounding opens no gap between them. Holes too small to be cut through are filled.
    """
    todo = [part for part in shapely.get_parts(region) if isinstance(part, Polygon) and not part.is_empty]
    done: list[Polygon] = []
    while todo:
        polygon = todo.pop()
        if not polygon.interiors:
            done.append(polygon)
            continue
        west, south, east, north = polygon.bounds
        hair = 1e-9 * max(east - west, north - south)
        low_x, low_y, high_x, high_y = max((ring.bounds for ring in polygon.interiors), key=_longest)
        if _longest((low_x, low_y, high_x, high_y)) < 1000 * hair:
            done.append(Polygon(polygon.exterior))
            continue
        if high_x - low_x >= high_y - low_y:
            cut = (low_x + high_x) / 2
            halves = (west - 1, south - 1, cut + hair, north + 1), (cut - hair, south - 1, east + 1, north + 1)
        else:
            cut = (low_y + high_y) / 2
            halves = (west - 1, south - 1, east + 1, cut + hair), (west - 1, cut - hair, east + 1, north + 1)
        for half in halves:
            part = shapely.intersection(polygon, shapely.box(*half))
            todo += [piece for piece in shapely.get_parts(part) if isinstance(piece, Polygon) and piece.area > 0]
    return done


def _longest(bounds: tuple[float, float, float, float]) -> float:
    return max(bounds[2] - bounds[0], bounds[3] - bounds[1])
