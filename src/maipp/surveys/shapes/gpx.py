"""GPX 1.0 and 1.1: tracks and routes along a shore, each closed to an area."""

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.files import read_bytes
from maipp.geo import WGS84
from maipp.surveys.shapes.drawing import Drawing, Rings, drawing_of, named_closed, wrong
from maipp.surveys.shapes.xml_text import LARGEST, children, local_name, parse_xml, text_of

_GIVE = "a GPX file whose tracks or routes lead around the area"
_FEW = 0.02  # share of the area that loops may hold which a wandering receiver draws
_GAP = 0.1  # share of the way around that may be missing without being told


def load_gpx(path: Path) -> Drawing:
    """The areas around which the tracks and routes of a GPX file lead; waypoints are left out, and told.

    Small loops, as a receiver draws where the track meets itself, are cut off. Raises `InputError` naming the file.
    """
    root = parse_xml(read_bytes(path, "track", LARGEST), str(path), "GPX file")
    if local_name(root) != "gpx":
        wrong(str(path), f"is XML, but no GPX file (its first element is {local_name(root)[:40]!r}); give {_GIVE}")
    polygons, notes = [], []
    for number, (name, points) in enumerate(track_points(root, str(path)), start=1):
        where = f"{path}: {name!r}" if name else f"{path}: track {number}"
        ring = _closed(points, where, notes)
        polygons.append(Rings(where, [ring], WGS84, name, named_closed(name)))
    left_out = ["waypoint" for _ in children(root, "wpt")]
    drawing = drawing_of(str(path), polygons, left_out, _GIVE)
    return drawing._replace(notes=(*drawing.notes, *notes))


def track_points(root: Xml.Element, where: str) -> list[tuple[str, list[Xml.Element]]]:
    """The name and the points of every track, its segments joined, and of every route."""
    found = []
    for track in children(root, "trk"):
        points = [point for segment in children(track, "trkseg") for point in children(segment, "trkpt")]
        found.append((text_of(track, "name"), points))
    found += [(text_of(route, "name"), list(children(route, "rtept"))) for route in children(root, "rte")]
    return [(name, points) for name, points in found if points]


def place_of(point: Xml.Element, where: str) -> list[float]:
    """Longitude and latitude of a point."""
    try:
        return [float(point.attrib["lon"]), float(point.attrib["lat"])]
    except (KeyError, ValueError):
        wrong(where, f"a point has lon={point.get('lon')!r} and lat={point.get('lat')!r}; both must be numbers")


def _closed(points: list[Xml.Element], where: str, notes: list[str]) -> list[list[float]]:
    """The positions of a ring, without small loops; adds to the notes."""
    ring = [place_of(point, where) for point in points]
    places = np.array(ring)
    if len(ring) < 3 or not (np.abs(places) <= 360).all():
        return ring  # which `to_polygon` refuses
    steps = np.hypot(*np.diff(places, axis=0).T)
    gap = float(np.hypot(*(places[0] - places[-1])))
    if gap > _GAP * (steps.sum() + gap):
        notes.append(f"{where}: its ends lie apart, and are joined by a straight line to close the area")
    polygon = Polygon(places)
    if polygon.is_valid:
        return ring
    parts = [part for part in shapely.get_parts(shapely.make_valid(polygon)) if isinstance(part, Polygon)]
    largest = max(parts, key=lambda part: part.area, default=None)
    if largest is None or largest.area < (1 - _FEW) * sum(part.area for part in parts):
        return ring
    notes.append(f"{where}: crosses itself; what its loops hold, less than {_FEW:.0%} of the area, is left out")
    return shapely.get_coordinates(largest.exterior).tolist()
