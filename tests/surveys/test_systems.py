"""Files in any coordinate reference system land in the one frame of a survey, their areas and lengths true metres."""

import json
import shutil
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import shapely

from maipp.errors import InputError
from maipp.geo import WGS84, read_crs, transform
from maipp.surveys.raster_field import raster_field
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey

pyproj = pytest.importorskip("pyproj")
rasterio = pytest.importorskip("rasterio")
GEOD = pyproj.Geod(ellps="WGS84")
DATA = Path(__file__).parents[1] / "data"

LAKE = (13.30, 53.40, 13.33, 53.415)  # Brandenburg, degrees of WGS84
CITY = (-73.99, 40.70, -73.96, 40.715)  # New York

MISSION = """\
area: {area}
robots:
  - {{name: boat, start: {start}, speed: 1.0, budget_m: 1000}}
measurement_spacing_m: 100
kernel: {{length_scale_m: 300, mean: 9, std: 4}}
"""


def corners(box, crs):
    """The box's outline in a system, each side in small pieces, and its true area."""
    outline = shapely.get_coordinates(shapely.segmentize(shapely.box(*box), 0.0005))
    there = np.stack(pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(*outline.T), axis=-1)
    return there, abs(GEOD.polygon_area_perimeter(*outline.T)[0])


def write_box(path, box, crs, cells=120):
    """A map that is below 0 in the box, its edges a little slanted as the system has it, and 1 around it."""
    from rasterio.transform import from_bounds

    (west, south), (east, north) = (corners(box, crs)[0].min(axis=0), corners(box, crs)[0].max(axis=0))
    dx, dy = (east - west) / 10, (north - south) / 10
    west, south, east, north = west - dx, south - dy, east + dx, north + dy
    x = west + (east - west) * (np.arange(cells) + 0.5) / cells
    y = north - (north - south) * (np.arange(cells) + 0.5) / cells
    back = pyproj.Transformer.from_crs(crs, 4326, always_xy=True)
    longitude, latitude = back.transform(*np.meshgrid(x, y))
    # How far outside of the box, in shares of its sides: 0 on its border.
    sides = np.array([box[2] - box[0], box[3] - box[1]])
    middle = np.array([box[0] + box[2], box[1] + box[3]]) / 2
    values = np.maximum(np.abs(longitude - middle[0]) / sides[0], np.abs(latitude - middle[1]) / sides[1]) - 0.5
    profile = {"driver": "GTiff", "height": cells, "width": cells, "count": 1, "dtype": "float32", "crs": crs}
    transform = from_bounds(west, south, east, north, cells, cells)
    with rasterio.open(path, "w", transform=transform, **profile) as file:
        file.write(values.astype(np.float32), 1)
    return path


def prepared(folder, text):
    return prepare(parse_survey(text, source="m.yaml", folder=folder))


@pytest.mark.parametrize(
    ("box", "crs"),
    [(LAKE, "EPSG:3857"), (LAKE, "EPSG:25833"), (LAKE, "EPSG:4314"), (LAKE, "EPSG:4326"), (CITY, "EPSG:2263")],
)
def test_an_area_is_as_large_as_on_the_ground(tmp_path, box, crs):
    # The mission says degrees, whatever the file is in.
    write_box(tmp_path / "map.tif", box, crs)
    start = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2]
    ready = prepared(tmp_path, MISSION.format(area="{raster: map.tif, below: 0}", start=start))
    assert ready.free_area == pytest.approx(corners(box, crs)[1], rel=0.005)
    assert ready.frame.geographic and ready.frame.crs == WGS84
    np.testing.assert_allclose(ready.frame.to_user(np.array(ready.scenario.starts))[0], start, atol=1e-6)
    # And it lies where it is.
    middle = shapely.Polygon(ready.area).centroid
    assert GEOD.inv(middle.x, middle.y, *start)[2] < 10


@pytest.mark.parametrize("said", ["metres: true", "crs: EPSG:3857"])
def test_web_mercator_is_not_metres(tmp_path, said):
    # A case from the field: 8.25 km2 as the file has it.
    shutil.copy(DATA / "webmercator.tif", tmp_path)
    text = MISSION.format(area="{raster: webmercator.tif, below: 0}", start=[1480883.2, 7057892.7]) + said + "\n"
    ready = prepared(tmp_path, text)
    assert ready.free_area == pytest.approx(2.96e6, rel=0.005)
    start = transform(np.array([1480883.2, 7057892.7]), read_crs("EPSG:3857", "x"), WGS84)
    np.testing.assert_allclose(ready.frame.to_user(np.array(ready.scenario.starts))[0], start, atol=1e-6)


def test_everything_lands_in_one_frame(tmp_path):
    # The area in EPSG:3857, a zone in Gauss-Krueger, samples in degrees and in UTM, a map in UTM.
    write_box(tmp_path / "map.tif", LAKE, "EPSG:3857")
    write_box(tmp_path / "truth.tif", (13.29, 53.39, 13.34, 53.42), "EPSG:25833")
    zone, zone_area = corners((13.310, 53.405, 13.314, 53.407), "EPSG:31468")
    member = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::31468"}}
    content = {"type": "Polygon", "coordinates": [zone.tolist()], "crs": member}
    (tmp_path / "zone.geojson").write_text(json.dumps(content))
    rng = np.random.default_rng(0)
    places = rng.uniform(LAKE[:2], LAKE[2:], (30, 2))
    utm = np.stack(pyproj.Transformer.from_crs(4326, 25833, always_xy=True).transform(*places.T), axis=-1)
    for name, header, points in (("degrees", "lon,lat,chl", places), ("utm", "x,y,chl", utm)):
        rows = [f"{x:.8f},{y:.8f},{v:.3f}" for (x, y), v in zip(points, rng.normal(9, 4, 30), strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *rows]))
    start = corners((13.305, 53.403, 13.306, 53.404), "EPSG:3857")[0][0].tolist()
    text = MISSION.format(area="{raster: map.tif, below: 0}", start=start) + "metres: true\nno_go: zone.geojson\n"
    for samples in ("degrees.csv", "{file: utm.csv, crs: EPSG:25833}"):
        ready = prepared(tmp_path, text + f"samples: {samples}\n")
        np.testing.assert_allclose(ready.frame.to_user(ready.prior_x), places, atol=1e-6)
        assert shapely.Polygon(ready.frame.to_plane(ready.no_go[0])).area == pytest.approx(zone_area, rel=0.01)
        assert ready.warnings == ()
    field = raster_field(ready, tmp_path / "truth.tif")
    border = ready.frame.to_domain(np.array([[13.29 + 0.05 * 0.75, 53.405]]))
    read = float(ready.frame.to_user_values(np.asarray(field(jnp.asarray(border))))[0])
    assert read == pytest.approx(0.25 - 0.5, abs=0.005)  # a quarter of the map's width east of its middle


@pytest.mark.parametrize(
    ("crs", "added", "told"),
    [
        ("EPSG:2263", "metres: true", r"m.yaml:1: area: is in EPSG:2263 \(units of 0.3048006 m\), but metres: true"),
        ("EPSG:4314", "metres: true", r"m.yaml:1: area: is in EPSG:4314 \(degrees\), but metres: true"),
        ("EPSG:3857", "crs: EPSG:4326\nmetres: true", "m.yaml:6: crs: EPSG:4326 .degrees. has no metres"),
        ("EPSG:3857", "crs: Atlantis", "m.yaml:6: crs: 'Atlantis' is no coordinate reference system"),
        ("EPSG:3857", "crs: none", "m.yaml:6: crs: is no place on Earth"),
        (
            "EPSG:3857",
            "metres: true\nno_go: plain.geojson\nsamples: {file: a.csv, crs: EPSG:5}",
            "m.yaml:8: samples.crs",
        ),
    ],
)
def test_what_contradicts_is_told(tmp_path, crs, added, told):
    box = CITY if crs == "EPSG:2263" else LAKE
    write_box(tmp_path / "map.tif", box, crs, cells=20)
    (tmp_path / "plain.geojson").write_text('{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}')
    (tmp_path / "a.csv").write_text("x,y,v\n1,2,3\n")
    with pytest.raises(InputError, match=f"^{told}") as caught:
        prepared(tmp_path, MISSION.format(area="{raster: map.tif, below: 0}", start=[1, 2]) + added + "\n")
    assert "\n" not in str(caught.value)


def test_a_plane_of_no_known_place_takes_no_file_that_has_one(tmp_path):
    text = MISSION.format(area="[[0, 0], [1000, 0], [1000, 500]]", start=[600, 100]) + "metres: true\n"
    (tmp_path / "a.csv").write_text("lon,lat,v\n13.3,53.4,3\n")
    with pytest.raises(InputError, match=r"a.csv: is in EPSG:4326 \(degrees\), but where the metres .* give"):
        prepared(tmp_path, text + "samples: a.csv\n")
    write_box(tmp_path / "truth.tif", LAKE, "EPSG:25833", cells=20)
    with pytest.raises(InputError, match=r"truth.tif: is in EPSG:25833 \(metres\), but where"):
        raster_field(prepared(tmp_path, text), tmp_path / "truth.tif")


def test_geojson_without_a_system_is_in_degrees(tmp_path):
    outline, area = corners(LAKE, "EPSG:4326")
    (tmp_path / "lake.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [outline.tolist()]}))
    start = corners((13.31, 53.405, 13.311, 53.406), "EPSG:25833")[0][0].tolist()
    ready = prepared(tmp_path, MISSION.format(area="lake.geojson", start=start) + "crs: EPSG:25833\n")
    assert ready.free_area == pytest.approx(area, rel=1e-4)
    linked = {
        "type": "Polygon",
        "coordinates": [outline.tolist()],
        "crs": {"type": "link", "properties": {"href": "x"}},
    }
    (tmp_path / "lake.geojson").write_text(json.dumps(linked))
    with pytest.raises(InputError, match=r"lake.geojson: crs: .* names no reference system; convert the file"):
        prepared(tmp_path, MISSION.format(area="lake.geojson", start=start))
