"""A file of polygons, read as its suffix says."""

from collections.abc import Callable
from pathlib import Path

from maipp.geo import WGS84, Crs
from maipp.surveys.shapes.drawing import Drawing, wrong
from maipp.surveys.shapes.geojson import load_geojson
from maipp.surveys.shapes.gis import load_gis
from maipp.surveys.shapes.gpx import load_gpx
from maipp.surveys.shapes.kml import load_kml
from maipp.surveys.shapes.qgc_plan import load_plan

_READERS: dict[str, Callable[[Path], Drawing]] = {
    ".kml": load_kml,
    ".kmz": load_kml,
    ".gpx": load_gpx,
    ".plan": load_plan,
}
_GIS = (".gpkg", ".shp")
FORMATS = "GeoJSON, KML, KMZ, GPX, QGroundControl .plan, GeoPackage or Shapefile"


def load_drawing(
    path: Path, geojson: Crs | None = WGS84, *, layer: str | None = None, crs: Crs | None = None
) -> Drawing:
    """What the file draws; one of another suffix is read as GeoJSON, whose positions are in `geojson`.

    `layer` names one of a GeoPackage's. `crs` stands in place of what the file says its positions are.
    Raises `InputError` naming the file, and in it the place of what is wrong.
    """
    suffix = path.suffix.lower()
    if suffix in _GIS:
        return load_gis(path, layer, crs)
    if layer is not None:
        wrong(str(path), "has no layers; only a GeoPackage or Shapefile has")
    drawing = _READERS[suffix](path) if suffix in _READERS else load_geojson(path, geojson)
    if crs is None:
        return drawing
    return drawing._replace(polygons=tuple(rings._replace(crs=crs) for rings in drawing.polygons))
