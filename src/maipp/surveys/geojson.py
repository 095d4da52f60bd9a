"""Polygons as people write them: GeoJSON files, the same inline, and plain lists of positions."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from maipp.errors import InputError
from maipp.files import read_text
from maipp.geo import WGS84, Crs, check_degrees, read_crs, unwrap
from maipp.records import read_json, show
from maipp.typing import Float

_SHAPES = "a Polygon, MultiPolygon, Feature or FeatureCollection"
_MOST_VERTICES = 1_000_000


class Rings(NamedTuple):
    """One polygon as written: its outer ring, then its holes; `where` says where, for errors."""

    where: str
    rings: list[Any]  # lists of positions
    crs: Crs | None = None  # what the positions are; None: what the mission says


def load_geojson(path: Path, otherwise: Crs | None = WGS84) -> list[Rings]:
    """The polygons in a GeoJSON file; without a `crs` of its own its positions are in `otherwise`.

    Raises `InputError` naming the file, and in it the place of what is wrong.
    """
    text = read_text(path, "polygons", "a GeoJSON file")
    return polygons_in(read_json(text, str(path)).value, str(path), otherwise)


def polygons_in(content: object, where: str, otherwise: Crs | None = None) -> list[Rings]:
    """The polygons of a GeoJSON object, at least one. Points and lines beside them are an error, not ignored.

    A `crs` as GeoJSON had it before RFC 7946 says what the positions are, in place of `otherwise`.
    """
    crs = _crs(content, where) or otherwise
    try:
        found = [rings._replace(crs=crs) for rings in _polygons(content, where)]
    except RecursionError:
        raise InputError(f"{where}: nested too deeply; give {_SHAPES}") from None
    if not found:
        raise InputError(f"{where}: holds no polygon; give {_SHAPES}")
    return found


def _crs(content: object, where: str) -> Crs | None:
    """The reference system that the object names; None where it names none."""
    member = content.get("crs") if isinstance(content, dict) else None
    if member is None:
        return None
    properties = member.get("properties") if isinstance(member, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        _wrong(f"{where}: crs", f"{show(member)} names no reference system; convert the file to WGS84 and leave it out")
    return read_crs(name, f"{where}: crs")


def _polygons(content: object, where: str) -> Iterator[Rings]:
    if not isinstance(content, dict):
        _wrong(where, f"{show(content)} is not GeoJSON; give {_SHAPES}")
    kind = content.get("type")
    if kind == "FeatureCollection":
        for index, feature in enumerate(_list(content, "features", where)):
            yield from _polygons(feature, f"{where}: features[{index}]")
    elif kind == "Feature":
        if content.get("geometry") is None:
            _wrong(where, f"has no geometry; give {_SHAPES}")
        yield from _polygons(content["geometry"], f"{where}: geometry")
    elif kind == "GeometryCollection":
        for index, geometry in enumerate(_list(content, "geometries", where)):
            yield from _polygons(geometry, f"{where}: geometries[{index}]")
    elif kind == "Polygon":
        yield Rings(where, _list(content, "coordinates", where))
    elif kind == "MultiPolygon":
        for index, rings in enumerate(_list(content, "coordinates", where)):
            if not isinstance(rings, list):
                _wrong(f"{where}: coordinates[{index}]", f"{show(rings)} is not a list of rings")
            yield Rings(f"{where}: coordinates[{index}]", rings)
    else:
        _wrong(where, f"has the type {show(kind)}; give {_SHAPES}")


def _list(content: dict[str, Any], key: str, where: str) -> list[Any]:
    value = content.get(key)
    return value if isinstance(value, list) else _wrong(where, f"has no list {key!r}; give {_SHAPES}")


def to_polygon(written: Rings, crs: Crs) -> Polygon:
    """The polygon, its vertices (x, y) or (longitude, latitude) in this system, checked.

    Longitudes come out within 180 degrees of its first vertex, so that an area across the 180th meridian is one piece.
    Raises `InputError` for positions that are none, outside the range of degrees, too few, on one line, and for rings
    that cross themselves, with the place.
    """
    if not written.rings:
        _wrong(written.where, "has no ring; give a list of rings, each a list of positions")
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
        _wrong(written.where, problem)
    return polygon


def _ring(ring: object, where: str, crs: Crs) -> Float[np.ndarray, "v 2"]:
    if not isinstance(ring, list) or not ring:
        _wrong(where, f"{show(ring)} is not a ring; give a list of positions")
    if len(ring) > _MOST_VERTICES:
        _wrong(where, f"has {len(ring)} vertices; simplify it to {_MOST_VERTICES} at most")
    for index, position in enumerate(ring):
        right = isinstance(position, list) and 2 <= len(position) <= 4
        if not right or not all(isinstance(c, int | float) and not isinstance(c, bool) for c in position):
            axes = "[longitude, latitude]" if crs.geographic else "[x, y]"
            _wrong(where, f"position {index} is {show(position)}; give {axes}")
        if not all(abs(c) < 1e15 for c in position):  # false for NaN as well
            _wrong(where, f"position {index} is {show(position)}; give finite numbers")
    points = np.array([position[:2] for position in ring], np.float64)
    if crs == WGS84:
        check_degrees(points, where)
    distinct = len(np.unique(points, axis=0))
    if distinct < 3:
        _wrong(where, f"has {distinct} distinct positions; a polygon needs at least 3")
    centred = points - points.mean(axis=0)
    if np.linalg.matrix_rank(centred / max(float(np.abs(centred).max()), 1e-300)) < 2:
        _wrong(where, "its positions lie on one line; give it an area")
    return points


def _named(written: Rings, index: int) -> str:
    return written.where if index == 0 else f"{written.where}: hole {index - 1}"


def _wrong(where: str, problem: str) -> NoReturn:
    raise InputError(f"{where}: {problem}")
