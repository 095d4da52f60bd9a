"""Targets of the survey: samples, areas, mission files, requests of a live survey."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_check import Target

from maipp.fields.samples import load_samples
from maipp.geo import WGS84
from maipp.live.events import read_event
from maipp.live.request import parse_line
from maipp.surveys.projected_area import find_place
from maipp.surveys.shapes import load_drawing, to_polygon
from maipp.surveys.survey_io import load_survey
from maipp.surveys.template import TEMPLATE

_WORDS = (b"longitude", b"lat", b"easting", b"value", b"na", b"-", b";", b"\t", b"1,5", b"#")
_GEO = (
    b'"Polygon"',
    b'"MultiPolygon"',
    b'"Feature"',
    b'"FeatureCollection"',
    b'"Point"',
    b"[]",
    b"{}",
    b"null",
    b"181",
)
_KEYS = (
    b"metres: true",
    b"area",
    b"no_go",
    b"below: true",
    b"robots",
    b"samples",
    b"raster",
    b"vehicle",
    b"&a",
    b"*a",
    b"!!float",
    b"~",
)
_EVENTS = (
    *(b'"measurement"', b'"arrived"', b'"gone"', b'"budget"', b'"heard"', b'"speed"', b'"zone"', b'"joined"'),
    *(b'"id"', b'"start"', b"null", b"[]", b"{}"),
)


def _samples_seeds() -> list[bytes]:
    rows = [(4.73, 52.24, 9.5), (4.731, 52.241, 10.0), (4.74, 52.245, 12.25), (4.745, 52.246, 7.0)]
    plain = "\n".join(",".join(map(str, row)) for row in rows)
    german = "\n".join(";".join(str(cell).replace(".", ",") for cell in row) for row in rows)
    dated = "\n".join(f"{i},2024-05-0{i + 1},{a},{b},{c}" for i, (a, b, c) in enumerate(rows))
    texts = (f"lon,lat,chl\n{plain}\n", plain, f"lat;lon;chl (ug/L)\n{german}\n", f"id,date,lon,lat,chl\n{dated}\n")
    return [text.encode() for text in texts]


def _geojson_seeds() -> list[bytes]:
    ring = [[4.73, 52.24], [4.746, 52.24], [4.748, 52.246], [4.74, 52.25], [4.73, 52.24]]
    hole = [[4.737, 52.244], [4.739, 52.244], [4.739, 52.2455], [4.737, 52.244]]
    polygon = {"type": "Polygon", "coordinates": [ring, hole]}
    feature = {"type": "Feature", "properties": {"name": "lake"}, "geometry": polygon}
    many = {"type": "MultiPolygon", "coordinates": [[ring], [hole]]}
    contents = (polygon, feature, {"type": "FeatureCollection", "features": [feature, feature]}, many)
    return [json.dumps(content).encode() for content in contents]


def _survey_seeds() -> list[bytes]:
    bare = "\n".join(line for line in TEMPLATE.splitlines() if not line.startswith("#"))
    metres = "metres: true\n" + bare.replace("4.7", "40").replace("52.2", "52")
    return [TEMPLATE.encode(), bare.encode(), metres.encode()]


def _event_seeds() -> list[bytes]:
    events: list[dict[str, Any]] = [
        {"event": "measurement", "id": "m1", "robot": "a", "position": [4.73, 52.24], "value": 9.5, "time": 12.0},
        {"event": "arrived", "id": "a1", "robot": "b", "position": [4.73, 52.24], "time": 3, "travelled": 100.5},
        {"event": "gone", "id": "g1", "robot": "a", "time": 30.0},
        {"event": "budget", "id": "b1", "robot": "b", "budget": 800.0, "time": 3.0},
        {"event": "speed", "id": "s1", "robot": "b", "speed": 0.5, "time": 3.0},
        {"event": "threshold", "id": "t1", "threshold": 12, "time": 3.0},
        {"event": "zone", "id": "z1", "name": "ferry", "polygon": [[4.7, 52.2], [4.8, 52.2], [4.8, 52.3]], "time": 3.0},
        {"event": "joined", "id": "j1", "robot": "c", "position": [4.73, 52.24], "budget": 800, "speed": 1.5, "time": 9}
        | {"end": [[4.73, 52.24], [4.74, 52.24]]},
    ]
    return [json.dumps(event).encode() for event in events]


def _event(path: Path) -> Any:
    return read_event(parse_line(path.read_bytes()), ["a", "b"])


def _area(path: Path) -> Any:
    polygons = [to_polygon(written, written.crs or WGS84) for written in load_drawing(path).polygons]
    return [np.array(polygon.exterior.coords) for polygon in polygons]


def _survey(path: Path) -> Any:
    place = find_place(load_survey(path))
    return place.frame, place.area.bounds


_LAKE = "4.73,52.24,0 4.746,52.24 4.748,52.246 4.73,52.24"


def _kml_seeds() -> list[bytes]:
    ring = f"<LinearRing><coordinates>{_LAKE}</coordinates></LinearRing>"
    hole = "<LinearRing><coordinates>4.74,52.241 4.745,52.241 4.745,52.243</coordinates></LinearRing>"
    polygon = f"<Polygon><outerBoundaryIs>{ring}</outerBoundaryIs><innerBoundaryIs>{hole}</innerBoundaryIs></Polygon>"
    mark = f"<Placemark><name>Lake</name><MultiGeometry>{polygon}<Point/></MultiGeometry></Placemark>"
    text = f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder><name>no-go</name>{mark}</Folder></Document></kml>'
    return [text.encode(), f'<?xml version="1.0" encoding="UTF-16"?>{text}'.encode("utf-16")]


def _kmz_seeds() -> list[bytes]:
    seeds = []
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        file = io.BytesIO()
        with zipfile.ZipFile(file, "w", method) as archive:
            archive.writestr("doc.kml", _kml_seeds()[0])
        seeds.append(file.getvalue())
    return seeds


def _gpx_seeds() -> list[bytes]:
    places = [each.split(",")[:2] for each in _LAKE.split()]
    points = "".join(f'<trkpt lon="{x}" lat="{y}"><time>2026-05-01T10:00:00Z</time></trkpt>' for x, y in places)
    return [f"<gpx><wpt lat='1' lon='2'/><trk><name>a</name><trkseg>{points}</trkseg></trk></gpx>".encode()]


def _plan_seeds() -> list[bytes]:
    lake = [[52.24, 4.73], [52.24, 4.746], [52.246, 4.748]]
    circle = {"inclusion": False, "circle": {"center": [52.241, 4.74], "radius": 50}, "version": 1}
    fence = {"polygons": [{"inclusion": True, "polygon": lake, "version": 1}], "circles": [circle], "version": 2}
    mission = {"items": [{"type": "ComplexItem", "polygon": lake}], "plannedHomePosition": [52.24, 4.73, 0]}
    return [json.dumps({"fileType": "Plan", "version": 1, "geoFence": fence, "mission": mission}).encode()]


SURVEY_TARGETS: dict[str, Target] = {
    "samples": Target(".csv", load_samples, _samples_seeds, _WORDS),
    "area-geojson": Target(".geojson", _area, _geojson_seeds, _GEO),
    "area-kml": Target(".kml", _area, _kml_seeds, (b"<Polygon>", b"<coordinates>", b"</", b"&#", b"<!DOCTYPE", b",")),
    "area-kmz": Target(".kmz", _area, _kmz_seeds, (b"PK", b"doc.kml")),
    "area-gpx": Target(".gpx", _area, _gpx_seeds, (b"<trkpt", b"lat=", b"nan", b"1e999", b"</")),
    "area-plan": Target(".plan", _area, _plan_seeds, _GEO),
    "survey": Target(".yaml", _survey, _survey_seeds, _KEYS, slice=500),
    "live-event": Target(".json", _event, _event_seeds, _EVENTS, named=False),
}
