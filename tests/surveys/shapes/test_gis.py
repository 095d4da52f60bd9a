"""GeoPackage and Shapefile, written by GDAL."""

import numpy as np
import pyogrio
import pyogrio.raw
import pytest
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon

from maipp.errors import InputError
from maipp.geo import WGS84, read_crs
from maipp.surveys.shapes import load_drawing, to_polygon

LAKE = Polygon([(0, 0), (100, 0), (100, 100)], [[(50, 20), (60, 20), (60, 30)]])
PONDS = MultiPolygon([shapely.box(200, 0, 210, 10), shapely.box(220, 0, 230, 10)])


def write(path, shapes, names, *, kind="Unknown", crs="EPSG:25833", **more):
    wkb, columns = shapely.to_wkb(np.array(shapes, object)), [np.array(names, object)]
    pyogrio.raw.write(path, wkb, columns, ["Name"], geometry_type=kind, crs=crs, **more)
    return path


def test_a_geopackage_is_read_with_its_system(tmp_path):
    path = write(tmp_path / "a.gpkg", [LAKE, PONDS, Point(1, 1)], ["lake", "no-go ponds", "pier"])
    drawing = load_drawing(path)
    told = [(each.name, each.closed, each.crs) for each in drawing.polygons]
    crs = read_crs("EPSG:25833", "here")
    assert told == [("lake", None, crs), ("no-go ponds", True, crs), ("no-go ponds", True, crs)]
    assert to_polygon(drawing.polygons[0], crs).equals(LAKE) and "1 point" in drawing.notes[0]
    assert load_drawing(path, crs=WGS84).polygons[0].crs == WGS84


def test_of_several_layers_one_is_named(tmp_path):
    path = write(tmp_path / "a.gpkg", [LAKE], ["lake"], kind="Polygon", layer="water")
    write(path, [Point(1, 1)], ["pier"], kind="Point", layer="piers", append=True)
    assert len(load_drawing(path).polygons) == 1
    write(path, [PONDS], ["ponds"], kind="MultiPolygon", layer="ponds", append=True)
    with pytest.raises(InputError, match="choose one of its layers .*water, ponds"):
        load_drawing(path)
    assert len(load_drawing(path, layer="ponds").polygons) == 2
    with pytest.raises(InputError, match="no layer 'lake', only water, piers, ponds"):
        load_drawing(path, layer="lake")


def test_a_shapefile_needs_a_system(tmp_path):
    path = write(tmp_path / "a.shp", [LAKE], ["lake"], kind="Polygon")
    (rings,) = load_drawing(path).polygons
    assert to_polygon(rings, read_crs("EPSG:25833", "here")).equals(LAKE)
    path.with_suffix(".prj").unlink()
    with pytest.raises(InputError, match="does not say what its positions are"):
        load_drawing(path)
    assert load_drawing(path, crs=WGS84).polygons[0].crs == WGS84


def test_damaged_files_and_layers_elsewhere_are_told(tmp_path):
    path = tmp_path / "a.gpkg"
    path.write_bytes(b"SQLite format 3\0" + b"x" * 100)
    with pytest.raises(InputError, match="a.gpkg: cannot be read"):
        load_drawing(path)
    (tmp_path / "a.geojson").write_text("{}")
    with pytest.raises(InputError, match="has no layers"):
        load_drawing(tmp_path / "a.geojson", layer="lake")
