"""KML 2.2 and KMZ, as Google Earth and others write them (OGC 07-147r2): every polygon with its holes and names."""

import io
import lzma
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

from maipp.files import read_bytes
from maipp.geo import WGS84
from maipp.surveys.shapes.drawing import Drawing, Rings, drawing_of, named_closed, wrong
from maipp.surveys.shapes.xml_text import LARGEST, children, local_name, parse_xml, text_of

_GIVE = "a KML file in which the area is drawn as a polygon (in Google Earth: Add Polygon)"
_OTHERS = {
    "Point": "point",
    "LineString": "line",
    "Track": "track",
    "MultiTrack": "track",
    "Model": "model",
    "GroundOverlay": "picture",
    "NetworkLink": "link to another file",
}
_GROUPS = ("Folder", "Document", "Placemark")
_BROKEN = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, ValueError, RuntimeError)
_DEEPEST = 200  # folders within folders


def load_kml(path: Path) -> Drawing:
    """What a KML or KMZ file draws. Raises `InputError` naming the file and the placemark of what is wrong."""
    content = read_bytes(path, "polygons", LARGEST)
    if content[:2] == b"PK":
        content = _unpacked(content, str(path))
    root = parse_xml(content, str(path), "KML file")
    if local_name(root) != "kml":
        wrong(str(path), f"is XML, but no KML file (its first element is {local_name(root)[:40]!r}); give {_GIVE}")
    left_out: list[str] = []
    return drawing_of(str(path), list(_polygons(root, str(path), left_out)), left_out, _GIVE)


def _unpacked(content: bytes, where: str) -> bytes:
    """The first KML file in a KMZ archive, which is the one that counts."""
    unpacked = None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = (each for each in archive.infolist() if each.filename.lower().endswith(".kml"))
            if (inner := next(names, None)) is not None:
                with archive.open(inner) as file:
                    unpacked = file.read(LARGEST + 1)  # whatever size the archive states
    except _BROKEN as error:
        wrong(where, f"is no KMZ file, or is damaged ({type(error).__name__}); save it again")
    return wrong(where, "is an archive without a .kml file; give a KML or KMZ file") if unpacked is None else unpacked


def _polygons(root: Xml.Element, path: str, left_out: list[str]) -> Iterator[Rings]:
    """The polygons in the order of the file; what else is drawn goes into `left_out`."""
    todo: list[tuple[Xml.Element, tuple[str, ...]]] = [(root, ())]
    while todo:
        element, names = todo.pop()
        kind = local_name(element)
        if kind in _GROUPS:
            names = (*names, text_of(element, "name"))
            if len(names) > _DEEPEST:
                wrong(path, f"has folders within folders, more than {_DEEPEST}; save what is to be surveyed by itself")
        if kind == "Polygon" or (kind == "LinearRing" and element is not root):
            where = f"{path}: {names[-1]!r}" if names and names[-1] else path
            outer = [element] if kind == "LinearRing" else _rings(element, "outerBoundaryIs")
            rings = [_positions(ring, where) for ring in (*outer, *_rings(element, "innerBoundaryIs"))]
            # The names of a document are the file's, not the polygon's.
            yield Rings(where, rings, WGS84, names[-1] if names else "", named_closed(*names[1:]))
        elif kind in _OTHERS:
            left_out.append(_OTHERS[kind])
        else:
            todo += [(child, names) for child in reversed(element)]


def _rings(polygon: Xml.Element, boundary: str) -> list[Xml.Element]:
    return [ring for each in children(polygon, boundary) for ring in children(each, "LinearRing")]


def _positions(ring: Xml.Element, where: str) -> list[list[float]]:
    """Longitude and latitude of each vertex; heights are left out."""
    text = next((child.text or "" for child in children(ring, "coordinates")), "")
    positions = []
    for each in re.sub(r"\s*,\s*", ",", text).split():
        try:
            longitude, latitude = map(float, each.split(",")[:2])
        except ValueError:
            shown = each if len(each) <= 40 else f"{each[:37]}..."
            wrong(where, f"{shown!r} is no position; a vertex is longitude,latitude or longitude,latitude,height")
        positions.append([longitude, latitude])
    return positions
