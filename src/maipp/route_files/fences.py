"""The fence of a plan in no more vertices than an autopilot stores: inside the area, and around the zones."""

from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from maipp.route_files.route_plan import Ring, RoutePlan

# Vertices of all fences together: ArduPilot's documentation of polygon fences; PX4's pull request 18870, of 2021.
MOST = {"ardupilot": 70, "px4": 64}
_METRES = 111_320.0  # in a degree of latitude, near enough to simplify by
_FINEST, _COARSEST, _STEP = 0.25, 0.05, 1.25  # metres; share of the area's longest side; from one try to the next

_ROUND = 1.05  # buffers have chords for arcs, which lie nearer


class Fence(NamedTuple):
    """What an autopilot is to keep inside of, and out of."""

    area: Ring
    zones: tuple[Ring, ...]
    note: str | None = None  # what was lost, for people to read


def fence_of(plan: RoutePlan, most: int) -> Fence:
    """The fence in at most `most` vertices, simplified inward of the area and outward of the zones.

    No route crosses it: where that would take more vertices, it has more, and the note says so.
    """
    own = Fence(plan.area, plan.no_go)
    given = count = len(plan.area) + sum(map(len, plan.no_go))
    if given <= most:
        return own
    scale = _scale(plan)
    area, zones = Polygon(plan.area * scale), shapely.union_all([Polygon(zone * scale) for zone in plan.no_go])
    routes = shapely.union_all([_line(route.points * scale) for route in plan.routes])
    west, south, east, north = area.bounds
    best, tolerance = [plan.area * scale, *(zone * scale for zone in plan.no_go)], _FINEST
    while count > most and tolerance <= _COARSEST * max(east - west, north - south):
        inner, outer = _polygons(_grown(area, -tolerance)), _polygons(_grown(zones, tolerance))
        if len(inner) != 1 or not inner[0].contains(routes) or any(zone.intersects(routes) for zone in outer):
            break
        rings = [np.array(shapely.get_coordinates(each.exterior)[:-1]) for each in (*inner, *outer)]
        if (fewer := sum(map(len, rings))) < count:
            best, count = rings, fewer
        tolerance *= _STEP
    best = _without_vertices(best, most, area, zones, routes)
    found = Fence(best[0] / scale, tuple(zone / scale for zone in best[1:]))
    if (count := sum(map(len, best))) > most:
        note = f"the fence has {count} vertices, of which an autopilot may store {most} only; the routes are too near "
        return found._replace(note=note + "to it for fewer: give more clearance_m, or vehicle: {fence: false}")
    kept = Polygon(best[0]).difference(shapely.union_all([Polygon(zone) for zone in best[1:]])).area
    lost = 1 - kept / area.difference(zones).area
    note = f"the fence has {count} of {given} vertices to fit the autopilot; it leaves out {lost:.1%} of the free area"
    return found._replace(note=note)


def _without_vertices(
    rings: list[np.ndarray], most: int, area: BaseGeometry, zones: BaseGeometry, routes: BaseGeometry
) -> list[np.ndarray]:
    """The rings, the area's first, without the vertices that change them least, until `most` are left or none can go.

    The first ring stays inside the area, the others around the zones, and no route is crossed (all metres).
    """
    rings = [ring.copy() for ring in rings]
    while sum(map(len, rings)) > most:
        corners = [(which, at) for which, ring in enumerate(rings) if len(ring) > 3 for at in range(len(ring))]
        triangles = [Polygon(np.take(rings[which], [at - 1, at, at + 1], axis=0, mode="wrap")) for which, at in corners]
        for index in np.argsort([triangle.area for triangle in triangles]):
            (which, at), triangle = corners[index], triangles[index]
            left = np.delete(rings[which], at, axis=0)
            after, before = Polygon(left), Polygon(rings[which])
            if not after.is_valid:
                continue
            grows = after.area > before.area
            if which == 0:
                allowed = area.covers(triangle) if grows else not triangle.intersects(routes)
            else:
                allowed = not triangle.intersects(routes) if grows else triangle.intersection(zones).area == 0.0
            if allowed:
                rings[which] = left
                break
        else:
            break
    return rings


def _scale(plan: RoutePlan) -> Float[np.ndarray, "2"]:
    """Metres in a unit of x and y."""
    if not plan.geographic:
        return np.ones(2)
    latitude = float(np.radians(plan.area[:, 1].mean()))
    return _METRES * np.array([np.cos(latitude), 1.0])


def _line(points: Float[np.ndarray, "k 2"]) -> BaseGeometry:
    return LineString(points) if len(points) > 1 else Point(points[0])


def _grown(region: BaseGeometry, by: float) -> BaseGeometry:
    """The region grown by so many metres, shrunk if less than 0, in few vertices: never by more than twice that."""
    return region if region.is_empty else region.buffer(_ROUND * by).simplify(abs(by))


def _polygons(region: BaseGeometry) -> list[Polygon]:
    return [part for part in shapely.get_parts(region) if isinstance(part, Polygon) and not part.is_empty]
