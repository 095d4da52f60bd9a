"""KML and KMZ: every polygon with its holes and names; bounded, and nothing that grows."""

import io
import zipfile

import numpy as np
import pyogrio
import pyogrio.raw
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.geo import WGS84
from maipp.surveys.shapes import load_drawing, to_polygon
from maipp.surveys.shapes import xml_text as module

LAKE = "13.3,53.4,0 13.33,53.4,0 13.33,53.412,0 13.3,53.412,0 13.3,53.4,0"
HOLE = "13.312,53.404 13.312,53.407 13.318,53.407 13.318,53.404"


def polygon(outer=LAKE, *holes):
    inner = "".join(
        f"<innerBoundaryIs><LinearRing><coordinates>{hole}</coordinates></LinearRing></innerBoundaryIs>"
        for hole in holes
    )
    ring = f"<outerBoundaryIs><LinearRing><coordinates>{outer}</coordinates></LinearRing></outerBoundaryIs>"
    return f"<Polygon>{ring}{inner}</Polygon>"


def placemark(name, content):
    return f"<Placemark><name>{name}</name>{content}</Placemark>"


def kml(content, head='<?xml version="1.0" encoding="UTF-8"?>'):
    return f'{head}<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>No go</name>{content}</Document></kml>'


def load(folder, content, name="a.kml"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_drawing(path)


def zipped(**files):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name.replace("_", "."), content)
    return file.getvalue()


def test_every_polygon_is_found_with_its_holes_and_names(tmp_path):
    point, line = "<Point><coordinates>13.301,53.401</coordinates></Point>", "<LineString/>"
    islands = f"<Folder><name>Islands</name>{placemark('north', polygon(HOLE))}</Folder>"
    both = f"<MultiGeometry>{polygon()}{point}{polygon(HOLE)}</MultiGeometry>"
    content = kml(placemark("Lake", polygon(LAKE, HOLE)) + placemark("Pier", point) + islands + both + line)
    drawing = load(tmp_path, content)
    told = [(each.name, each.closed, len(each.rings)) for each in drawing.polygons]
    # The name of the document is the file's.
    assert told == [("Lake", None, 2), ("north", True, 1), ("No go", None, 1), ("No go", None, 1)]
    assert drawing.notes == (f"{tmp_path / 'a.kml'}: beside its polygons 2 points, 1 line, left out",)
    found = to_polygon(drawing.polygons[0], WGS84)
    assert found.bounds == (13.3, 53.4, 13.33, 53.412) and len(found.interiors) == 1


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1"])
def test_encodings_and_loose_coordinates(encoding, tmp_path):
    head = f'<?xml version="1.0" encoding="{encoding.removesuffix("-sig")}"?>'
    loose = LAKE.replace(",", " , ").replace(" 13", "\n\t 13")
    (rings,) = load(tmp_path, kml(placemark("Großer See", polygon(loose)), head).encode(encoding)).polygons
    assert rings.name == "Großer See" and to_polygon(rings, WGS84).area == pytest.approx(0.03 * 0.012)


def test_what_another_library_writes_comes_back(tmp_path):
    lake = Polygon([(4.7, 52.2), (4.8, 52.2), (4.75, 52.3)], [[(4.74, 52.22), (4.76, 52.22), (4.75, 52.24)]])
    island = shapely.box(4.0, 50.0, 4.1, 50.1)
    path = tmp_path / "written.kml"
    names = np.array(["lake", "keep-out"], object)
    pyogrio.raw.write(
        path,
        shapely.to_wkb(np.array([lake, island], object)),
        [names],
        ["Name"],
        driver="KML",
        geometry_type="Polygon",
        crs="EPSG:4326",
    )
    drawing = load_drawing(path)
    assert [(each.name, each.closed) for each in drawing.polygons] == [("lake", None), ("keep-out", True)]
    found = [to_polygon(rings, WGS84) for rings in drawing.polygons]
    assert found[0].equals(lake) and found[1].equals(island)


def test_a_kmz_holds_the_first_kml_file(tmp_path):
    content = zipped(images_png=b"\x89PNG", doc_kml=kml(polygon()), other_kml=kml(""))
    assert len(load(tmp_path, content, "a.kmz").polygons) == len(load(tmp_path, content, "b.kml").polygons) == 1


BOMB = '<!DOCTYPE k [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is no KML file, or is damaged"),
        (kml("<Placemark>"), "is damaged"),
        ("<gpx/>", "is XML, but no KML file (its first element is 'gpx')"),
        (kml(placemark("Pier", "<Point/>")), "holds no polygon, only 1 point; give a KML file"),
        (kml(placemark("Lake", polygon("13.3;53.4 x"))), "'Lake': '13.3;53.4' is no position"),
        (kml(polygon(), BOMB), "declares a document type"),
        (kml(polygon(), BOMB).encode("utf-16"), "declares a document type"),
        (kml("<Folder>" * 300 + polygon() + "</Folder>" * 300), "folders within folders"),
        (b"\xff\xfe\x00", "not text in utf-16"),
        ('<?xml version="1.0" encoding="klingon"?><kml/>', "not text in klingon"),
        (zipped(a_txt=b"x"), "is an archive without a .kml file"),
        (zipped(doc_kml=kml(polygon()))[:-30], "is no KMZ file, or is damaged"),
    ],
)
def test_what_is_wrong_is_one_line(content, problem, tmp_path):
    with pytest.raises(InputError) as error:
        load(tmp_path, content)
    assert str(error.value).startswith(str(tmp_path / "a.kml")) and problem in str(error.value)
    assert "\n" not in str(error.value)


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "LARGEST", 1000)
    monkeypatch.setattr("maipp.surveys.shapes.kml.LARGEST", 1000)
    with pytest.raises(InputError, match="simplify it"):
        load(tmp_path, zipped(doc_kml=kml(" " * 100_000)))


@given(content=st.text(alphabet="<>/kmlPoygncrdiates=\"' 13.5,&;![]", max_size=80))
def test_any_text_is_a_drawing_or_one_line(content, tmp_path_factory):
    try:
        load(tmp_path_factory.getbasetemp(), kml(content))
    except InputError as error:
        assert "\n" not in str(error)
