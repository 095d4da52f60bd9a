"""GeoPackage and Shapefile, by way of GDAL (pyogrio, the extra `gis`)."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.geo import Crs, read_crs
from maipp.surveys.shapes.drawing import Drawing, Rings, drawing_of, named_closed, wrong
from maipp.surveys.shapes.geojson import TELLING

_GIVE = "a layer of polygons"
_MOST = 100_000  # features
_POLYGON = "Polygon"


def load_gis(path: Path, layer: str | None = None, crs: Crs | None = None) -> Drawing:
    """What the layer draws: the one named, or the only one of polygons. `crs` stands in place of what the file says.

    Raises `InputError` where the file cannot be read, layers are left to choose, or nobody says what its positions are.
    """
    try:
        import pyogrio
        import pyogrio.errors
        import pyogrio.raw
    except ImportError:
        raise InputError(f"{path}: GeoPackage and Shapefile need pyogrio; pip install 'maipp[gis]'") from None
    source = str(path)
    try:
        with warnings.catch_warnings(action="ignore"):  # GDAL's doubts about files that it reads all the same
            chosen = _layer(pyogrio, source, layer)
            if pyogrio.read_info(path, layer=chosen)["features"] > _MOST:
                wrong(source, f"has more than {_MOST} features; cut it to the area")
            meta, _, shapes, columns = pyogrio.raw.read(path, layer=chosen)
        geometries = shapely.from_wkb(shapes)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, shapely.errors.GEOSException) as error:
        wrong(source, f"cannot be read ({' '.join(str(error).split())[:200]})")
    crs = crs or (read_crs(meta["crs"], source) if meta["crs"] else None)
    if crs is None:
        wrong(source, "does not say what its positions are; give {file: ..., crs: EPSG:...} with what they are")
    fields = {str(name).lower(): column for name, column in zip(meta["fields"], columns, strict=True)}
    telling = [fields[name] for name in TELLING if name in fields]
    found, left_out = [], []
    for index, geometry in enumerate(geometries):
        texts = [column[index] for column in telling if isinstance(column[index], str)]
        where = f"{source}: feature {index}"
        parts, others = _parts(geometry)
        left_out += others
        name = next(iter(texts), "")
        found += [Rings(where, _positions(part), crs, name, named_closed(*texts)) for part in parts]
    return drawing_of(source, found, left_out, _GIVE)


def _layer(pyogrio: Any, source: str, named: str | None) -> str:
    """The layer to read."""
    layers = {str(name): str(kind) for name, kind in pyogrio.list_layers(source)}
    if named is not None:
        return named if named in layers else wrong(source, f"has no layer {named!r}, only {', '.join(layers)}")
    polygons = [name for name, kind in layers.items() if _POLYGON in kind]
    candidates = polygons or list(layers)
    if len(candidates) != 1:
        wrong(source, f"choose one of its layers with {{file: ..., layer: NAME}}: {', '.join(candidates) or 'none'}")
    return candidates[0]


def _parts(geometry: Any) -> tuple[list[Polygon], list[str]]:
    """The polygons of a geometry, and a word for each part that is none."""
    if geometry is None or geometry.is_empty:
        return [], ["feature without a geometry"]
    parts = [part for collection in shapely.get_parts([geometry]) for part in shapely.get_parts([collection])]
    polygons = [part for part in parts if isinstance(part, Polygon)]
    return polygons, ["point" if "Point" in part.geom_type else "line" for part in parts if part not in polygons]


def _positions(polygon: Polygon) -> list[list[list[float]]]:
    rings = (polygon.exterior, *polygon.interiors)
    return [np.asarray(shapely.get_coordinates(ring)).tolist() for ring in rings]
