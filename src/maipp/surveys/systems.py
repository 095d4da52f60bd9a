"""Which coordinate reference system the positions of a mission and of its files are in, and the way to the frame."""

import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.geo import METRES, WGS84, Crs, check_degrees, transform, unwrap
from maipp.surveys.mission_file import MissionFile
from maipp.typing import Float

# Edges are straight in their own system, not in degrees: cut into pieces of this share of the polygon they follow their
# curve to some 1e-5 of it.
PIECES = 20


def mission_system(survey: MissionFile, area: Crs | None) -> Crs:
    """What the positions in the mission file are: as `crs` says, else WGS84, else the metres of the area's file.

    `area` is what the area's file says of itself. Raises `InputError` where it contradicts `metres: true`.
    """
    if survey.crs is not None:
        return survey.crs
    if not survey.metres:
        return WGS84
    if area is None or not area.located:
        return METRES
    if area.metres != 1.0:
        raise InputError(
            f"{survey.where('area')}: is in {area}, but metres: true says metres; leave out metres where the mission's "
            f"positions are degrees, or give crs: {area.name} in its place where they are as in that file"
        )
    return area


def file_system(crs: Crs | None, own: Crs, where: str) -> Crs:
    """What the coordinates of a file are in a mission whose own are `own`: as the file says, else as the mission's.

    Raises `InputError` for a file whose way to the mission's coordinates is not known.
    """
    if crs is None or crs.located:
        if crs is not None and not own.located:
            raise InputError(
                f"{where}: is in {crs}, but where the metres of the mission lie on Earth is not known; give the "
                "mission's crs in place of metres: true"
            )
        return crs or own
    if crs.metres is not None and crs.metres != own.metres and not own.geographic:
        raise InputError(f"{where}: has units of {crs.metres:g} m, the mission others; convert it")
    return own


def to_user(points: Float[np.ndarray, "*n 2"], crs: Crs, where: str) -> Float[np.ndarray, "*n 2"]:
    """The user's coordinates, WGS84 or metres of no known place, of positions in this system."""
    if crs == WGS84:
        check_degrees(points.reshape(-1, 2), where)
    return transform(points, crs, WGS84, where) if crs.located and crs != WGS84 else points


def polygon_to_user(polygon: Polygon, crs: Crs, where: str) -> Polygon:
    """The polygon in the user's coordinates; longitudes in one piece across the 180th meridian."""
    if crs == WGS84 or not crs.located:
        return polygon
    west, south, east, north = polygon.bounds
    dense = shapely.segmentize(polygon, max(east - west, north - south) / PIECES)
    rings = [to_user(shapely.get_coordinates(ring), crs, where) for ring in (dense.exterior, *dense.interiors)]
    reference = float(rings[0][0, 0])
    rings = [unwrap(ring, reference) for ring in rings]
    return Polygon(rings[0], rings[1:])
