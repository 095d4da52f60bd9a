"""The area and the no-go zones of a mission file, read, checked and projected to local metres."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from maipp.errors import InputError
from maipp.surveys.area import Start, Told, as_region, check_size
from maipp.surveys.frame import Frame
from maipp.surveys.geojson import check_degrees, to_polygon, unwrap
from maipp.surveys.raster_area import raster_polygons
from maipp.surveys.survey import RasterArea, Survey

# Edges of polygons in degrees are straight in degrees, not in metres: cut into pieces of this share of the area they
# follow their curve to some 1e-5 of the area.
_PIECES = 20


@dataclass(frozen=True)
class Place:
    """Where a survey is, in local metres."""

    frame: Frame  # values not yet standardised
    area: BaseGeometry
    no_go: BaseGeometry
    warnings: tuple[str, ...]


def find_place(survey: Survey) -> Place:
    """The frame and the geometry of a survey. Raises `InputError` for areas and zones that cannot be used."""
    where = survey.where("area")
    geographic = not survey.metres
    if isinstance(survey.area, RasterArea):
        polygons = raster_polygons(survey.area, geographic=geographic)
    else:
        polygons = [to_polygon(survey.area[0], geographic=geographic)]
        reference = polygons[0].exterior.coords[0][0]
        polygons += [to_polygon(rings, geographic=geographic, reference=reference) for rings in survey.area[1:]]
    reference = float(polygons[0].exterior.coords[0][0])
    west, south, east, north = shapely.total_bounds(np.array(polygons, object)).tolist()
    centre = (0.0, 0.0)
    if geographic:
        if east - west > 180 or max(-south, north) > 89:
            raise InputError(
                f"{where}: spans longitudes {west:g} to {east:g} and latitudes {south:g} to {north:g}, too much for "
                "one local projection; give a smaller area, or metric coordinates with `metres: true`"
            )
        centre = ((west + east) / 2, (south + north) / 2)
    frame = Frame(
        geographic, centre, (0.0, 0.0), (1.0, 1.0), below=survey.below, quantity=survey.quantity, unit=survey.unit
    )
    piece = max(east - west, north - south) / _PIECES
    area = as_region([_to_metres(frame, polygon, piece) for polygon in polygons])
    check_size(area.bounds, where)
    x0, y0, x1, y1 = area.bounds
    frame = dataclasses.replace(frame, origin=(x0, y0), size=(x1 - x0, y1 - y0))
    zones, warnings = [], []
    for zone in survey.no_go:
        parts = [to_polygon(rings, geographic=geographic, reference=reference) for rings in zone]
        region = as_region([_to_metres(frame, polygon, piece) for polygon in parts])
        if not region.intersects(area):
            warnings.append(f"{zone[0].where}: this no-go zone lies outside the area and changes nothing")
        zones.append(region)
    return Place(frame, area, as_region(zones), tuple(warnings))


def starts_of(survey: Survey, frame: Frame) -> list[Start]:
    """The starts of the robots, local metres. Raises `InputError` for what is no longitude and latitude."""
    starts = []
    for robot in survey.robots:
        if frame.geographic:
            check_degrees(np.array([robot.start]), robot.where)
        x, y = frame.to_metres(np.array(robot.start)).tolist()
        starts.append(Start((x, y), robot.where, robot.name))
    return starts


class PlaceNames(Told):
    """Places told in the user's coordinates."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame

    def place(self, point: Point) -> str:
        x, y = self.frame.from_metres(np.array([point.x, point.y])).tolist()
        return f"({x:.6f}, {y:.6f})" if self.frame.geographic else f"({x:.1f}, {y:.1f})"

    def swapped(self, start: Start) -> BaseGeometry | None:
        x, y = self.frame.from_metres(np.array(start.place)).tolist()
        if self.frame.geographic and abs(x) > 90:
            return None
        return Point(self.frame.to_metres(np.array([y, x])))


def _to_metres(frame: Frame, polygon: Polygon, piece: float) -> BaseGeometry:
    """The polygon in local metres."""
    if not frame.geographic:
        return polygon
    dense = shapely.segmentize(polygon, piece)
    # A position that the projection cannot place gives inf, which GEOS refuses: such zones are too far away.
    projected: Any = shapely.transform(dense, lambda points: frame.to_metres(unwrap(points, frame.centre[0])))
    if not np.isfinite(shapely.get_coordinates(projected)).all():
        raise InputError("a no-go zone lies on the other side of the earth; leave it out")
    return projected if projected.is_valid else shapely.make_valid(projected)
