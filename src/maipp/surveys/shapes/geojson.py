"""GeoJSON (RFC 7946), in files and inline."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from maipp.files import read_text
from maipp.geo import WGS84, Crs, read_crs
from maipp.records import read_json, show
from maipp.surveys.shapes.drawing import Drawing, Rings, drawing_of, named_closed, wrong

_SHAPES = "a Polygon, MultiPolygon, Feature or FeatureCollection"
_OTHERS = {
    "Point": "point",
    "MultiPoint": "point",
    "LineString": "line",
    "MultiLineString": "line",
}
# Properties that say what a feature is.
TELLING = ("name", "title", "label", "kind", "type", "role", "class", "category", "description")


def load_geojson(path: Path, otherwise: Crs | None = WGS84) -> Drawing:
    """What a GeoJSON file draws; without a `crs` of its own its positions are in `otherwise`.

    Raises `InputError` naming the file, and in it the place of what is wrong.
    """
    text = read_text(path, "polygons", "a GeoJSON file")
    return polygons_in(read_json(text, str(path)).value, str(path), otherwise)


def polygons_in(content: object, where: str, otherwise: Crs | None = None) -> Drawing:
    """The polygons of a GeoJSON object, at least one; points and lines beside them are left out, and told.

    A `crs` as GeoJSON had it before RFC 7946 says what the positions are, in place of `otherwise`.
    """
    crs = _crs(content, where) or otherwise
    left_out: list[str] = []
    try:
        found = [rings._replace(crs=crs) for rings in _polygons(content, where, left_out)]
    except RecursionError:
        wrong(where, f"nested too deeply; give {_SHAPES}")
    return drawing_of(where, found, left_out, _SHAPES)


def _crs(content: object, where: str) -> Crs | None:
    """The reference system that the object names; None where it names none."""
    member = content.get("crs") if isinstance(content, dict) else None
    if member is None:
        return None
    properties = member.get("properties") if isinstance(member, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        wrong(f"{where}: crs", f"{show(member)} names no reference system; convert the file to WGS84 and leave it out")
    return read_crs(name, f"{where}: crs")


def _polygons(content: object, where: str, left_out: list[str]) -> Iterator[Rings]:
    if not isinstance(content, dict):
        wrong(where, f"{show(content)} is not GeoJSON; give {_SHAPES}")
    kind = content.get("type")
    if kind == "FeatureCollection":
        for index, feature in enumerate(_list(content, "features", where)):
            yield from _polygons(feature, f"{where}: features[{index}]", left_out)
    elif kind == "Feature":
        if content.get("geometry") is None:
            left_out.append("feature without a geometry")
            return
        name, closed = _told(content.get("properties"))
        for rings in _polygons(content["geometry"], f"{where}: geometry", left_out):
            yield rings._replace(name=name, closed=closed)
    elif kind == "GeometryCollection":
        for index, geometry in enumerate(_list(content, "geometries", where)):
            yield from _polygons(geometry, f"{where}: geometries[{index}]", left_out)
    elif kind == "Polygon":
        yield Rings(where, _list(content, "coordinates", where))
    elif kind == "MultiPolygon":
        for index, rings in enumerate(_list(content, "coordinates", where)):
            if not isinstance(rings, list):
                wrong(f"{where}: coordinates[{index}]", f"{show(rings)} is not a list of rings")
            yield Rings(f"{where}: coordinates[{index}]", rings)
    elif isinstance(kind, str) and kind in _OTHERS:
        left_out.append(_OTHERS[kind])
    else:
        wrong(where, f"has the type {show(kind)}; give {_SHAPES}")


def _told(properties: object) -> tuple[str, bool | None]:
    """A feature's name, and whether its properties say that it must not be entered."""
    if not isinstance(properties, dict):
        return "", None
    told = {str(key).lower(): text for key, text in properties.items() if isinstance(text, str)}
    texts = [told[key] for key in TELLING if key in told]
    return next(iter(texts), ""), False if told.get("kind") == "area" else named_closed(*texts)


def _list(content: dict[str, Any], key: str, where: str) -> list[Any]:
    value = content.get(key)
    return value if isinstance(value, list) else wrong(where, f"has no list {key!r}; give {_SHAPES}")
