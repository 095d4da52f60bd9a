"""The area and the no-go zones of a mission file, read, checked and projected to local metres."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.affinity import translate
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from maipp.errors import InputError
from maipp.geo import WGS84, Crs, GeoReference, check_degrees
from maipp.surveys.area import Start, as_region, check_size
from maipp.surveys.mission_file import MissionFile, RasterArea
from maipp.surveys.raster_area import load_area, raster_polygons
from maipp.surveys.shapes import Drawing, Named, Rings, to_polygon, water_of
from maipp.surveys.systems import PIECES, file_system, mission_system, polygon_to_user, to_user


@dataclass(frozen=True)
class ProjectedArea:
    """Where a survey is, in local metres."""

    frame: GeoReference  # values not yet standardised
    area: BaseGeometry
    no_go: BaseGeometry
    crs: Crs  # of the positions in the mission file
    warnings: tuple[str, ...]


def find_place(survey: MissionFile) -> ProjectedArea:
    """The frame and the geometry of a survey. Raises `InputError` for areas and zones that cannot be used."""
    where, notes = survey.where("area"), list[str]()
    drawn_zones: Sequence[BaseGeometry] = ()
    if isinstance(survey.area, RasterArea):
        data, source = load_area(survey.area), str(survey.area.raster)
        own = mission_system(survey, data.crs)
        crs = file_system(data.crs, own, source)
        notes += data.notes
        if crs == WGS84:
            check_degrees(np.array([[data.x[0], data.y[0]], [data.x[-1], data.y[-1]]]), source)
        polygons = [polygon_to_user(part, crs, source) for part in raster_polygons(survey.area, data)]
    else:
        own = mission_system(survey, survey.area.polygons[0].crs)
        water = water_of(survey.area.source, _named(survey.area, own))
        polygons, drawn_zones = water.area, water.zones
        notes += [*survey.area.notes, *water.notes]
    geographic, centre = own.located, None
    reference = float(shapely.get_coordinates(polygons[0])[0, 0])
    if geographic:
        polygons = [_near(polygon, reference) for polygon in polygons]
    west, south, east, north = shapely.total_bounds(np.array(polygons, object)).tolist()
    if geographic:
        if east - west > 180 or max(-south, north) > 89:
            raise InputError(
                f"{where}: spans longitudes {west:g} to {east:g} and latitudes {south:g} to {north:g}, too much for "
                "one local projection; give a smaller area, or metric coordinates with `metres: true`"
            )
        centre = ((west + east) / 2, (south + north) / 2)
    longest = max(east - west, north - south)
    piece = longest / PIECES
    # What of a zone lies far from the area is cut off, before a zone across an ocean is cut into small pieces.
    near = shapely.box(west - longest, south - longest, east + longest, north + longest)
    unplaced = GeoReference.of_area((0.0, 0.0, 1.0, 1.0), centre)
    area = as_region([_to_metres(unplaced, polygon, piece) for polygon in polygons])
    check_size(area.bounds, where)
    frame = dataclasses.replace(GeoReference.of_area(area.bounds, centre), value_name=_quantity(survey))
    regions = []
    for source, parts in [(survey.where("area"), drawn_zones), *_zones(survey, own, notes)]:
        if not parts:
            continue
        if geographic:
            parts = [_near(polygon, reference) for polygon in parts]
        region = as_region([_to_metres(frame, shapely.intersection(polygon, near), piece) for polygon in parts])
        if not region.intersects(area):
            notes.append(f"{source}: this no-go zone lies outside the area and changes nothing")
        regions.append(region)
    return ProjectedArea(frame, area, as_region(regions), own, tuple(notes))


def _zones(survey: MissionFile, own: Crs, notes: list[str]) -> Iterator[tuple[str, Sequence[BaseGeometry]]]:
    """Where each no-go zone of the mission file is written, and its polygons; adds to the notes.

    What a file says is to be entered, as fences of a plan do, is no zone.
    """
    for zone in survey.no_go:
        parts = [each for each in zone.polygons if each.closed is not False]
        if not parts:
            raise InputError(f"{zone.source}: draws only what is to be entered; give the polygons of no-go zones")
        if len(parts) < len(zone.polygons):
            notes.append(f"{zone.source}: what it draws to be entered is no no-go zone, and left out")
        notes += zone.notes
        yield zone.source, [_polygon(rings, own) for rings in parts]


def starts_of(survey: MissionFile, place: ProjectedArea) -> list[Start]:
    """The starts of the robots, local metres. Raises `InputError` for what is no place in the mission's system."""
    starts = []
    for robot in survey.robots:
        start, crs = robot.start, place.crs
        if start is None and isinstance(survey.area, Drawing):  # where the area's file has vehicles set out
            start, crs = survey.area.home, file_system(survey.area.polygons[0].crs, crs, robot.where)
        x, y = place.frame.to_plane(to_user(np.array(start), crs, robot.where)).tolist()
        starts.append(Start((x, y), robot.where, robot.name))
    return starts


def ends_of(survey: MissionFile, place: ProjectedArea) -> list[list[Start]]:
    """The places where each robot may end, local metres; none where it is its start, or anywhere."""
    ends: list[list[Start]] = []
    for robot in survey.robots:
        written = np.array(robot.end if isinstance(robot.end, tuple) else ()).reshape(-1, 2)
        plane = [place.frame.to_plane(to_user(each, place.crs, robot.end_where)).tolist() for each in written]
        ends.append([Start((x, y), robot.end_where, robot.name, "end") for x, y in plane])
    return ends


def _named(drawing: Drawing, own: Crs) -> list[Named]:
    """All that a file draws, in the user's coordinates, near each other where they are degrees."""
    drawn = [Named(_polygon(rings, own), rings.name, rings.closed) for rings in drawing.polygons]
    if not own.located:
        return drawn
    reference = float(drawn[0].polygon.exterior.coords[0][0])
    return [each._replace(polygon=_near(each.polygon, reference)) for each in drawn]


def _polygon(written: Rings, own: Crs) -> Polygon:
    """A polygon as written, in the user's coordinates."""
    crs = file_system(written.crs, own, written.where)
    return polygon_to_user(to_polygon(written, crs), crs, written.where)


def _near(polygon: Any, reference: float) -> Any:
    """The polygon with all its longitudes moved by full turns to where the reference is."""
    west, _, east, _ = polygon.bounds
    turns = round((reference - (west + east) / 2) / 360.0)
    return translate(polygon, 360.0 * turns) if turns else polygon


def _quantity(survey: MissionFile) -> str:
    """The quantity with its unit behind it."""
    name = survey.quantity or "value"
    return f"{name} ({survey.unit})" if survey.unit else name


def _to_metres(frame: GeoReference, region: BaseGeometry, piece: float) -> BaseGeometry:
    """The polygons of a region in local metres."""
    if not frame.geographic:
        return region
    projected: Any = shapely.transform(shapely.segmentize(region, piece), frame.to_plane)
    return projected if projected.is_valid else shapely.make_valid(projected)
