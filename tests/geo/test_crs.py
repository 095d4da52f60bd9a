"""Systems are known by what they are, not by what they are called."""

import sys

import pytest

from maipp.errors import InputError
from maipp.geo import PLANE, WGS84, Crs, local_crs, read_crs

GEO = {"EPSG:25833": 1.0, "EPSG:3857": 1.0, "EPSG:2263": 1200 / 3937, "EPSG:3361": 0.3048}


@pytest.mark.parametrize(("code", "metres"), GEO.items())
def test_planes_have_their_unit(code, metres):
    pytest.importorskip("pyproj")
    crs = read_crs(code, "area")
    assert (crs.name, crs.geographic) == (code, False) and crs.metres == pytest.approx(metres, rel=1e-12)
    assert crs.located


@pytest.mark.parametrize("name", ["EPSG:4326", "wgs84", "OGC:CRS84", "urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4979"])
def test_degrees_of_wgs84_have_many_names(name):
    if name == "EPSG:4979":
        pytest.importorskip("pyproj")
    assert read_crs(name, "area") == WGS84


def test_other_degrees_are_their_own():
    pytest.importorskip("pyproj")
    assert read_crs("EPSG:4314", "area") == Crs("EPSG:4314", geographic=True)
    own = read_crs("+proj=utm +zone=33 +ellps=GRS80", "area")  # no code: its WKT
    assert not own.geographic and own.metres == 1 and own.name is not None and len(str(own)) < 100
    assert read_crs(own.name, "area") == own


def test_a_compound_system_is_its_horizontal_part():
    pytest.importorskip("pyproj")
    assert read_crs("EPSG:5555", "area").name == "EPSG:25832"  # ETRS89 / UTM 32 with heights


def test_no_place_on_earth():
    assert read_crs(" None ", "area") == PLANE and not PLANE.located and not PLANE.geographic
    pytest.importorskip("pyproj")
    site = read_crs('LOCAL_CS["site",UNIT["foot",0.3048]]', "area")
    assert not site.located and site.metres == pytest.approx(0.3048)


@pytest.mark.parametrize("text", ["EPSG:999999", "Atlantis", "", "EPSG:4978", "EPSG:5703", "{", "\0", "9" * 500])
def test_what_is_no_system_is_told(text):
    pytest.importorskip("pyproj")
    with pytest.raises(InputError, match="^area: .* give one such as EPSG:4326") as caught:
        read_crs(text, "area")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_without_pyproj_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(InputError, match=r"^area: EPSG:31468 needs pyproj; .* pip install 'maipp\[geo\]'"):
        read_crs("EPSG:31468", "area")
    assert read_crs("EPSG:4326", "area") == WGS84


def test_local_systems_are_read_back():
    pytest.importorskip("pyproj")
    crs = local_crs((13.3, 53.4))
    assert crs.metres == 1 and crs.located and read_crs(crs.name or "", "area").metres == 1
