from pathlib import Path
from xml.etree import ElementTree as Xml

import gpxpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.route_files.gpx import gpx_file

GOLDEN = Path(__file__).with_name("golden") / "routes.gpx"
NAMESPACE = "{http://www.topografix.com/GPX/1/1}"

# The sequences of the GPX 1.1 schema (gpxType, metadataType, wptType, rteType), as far as they are used here or
# stand between what is used: elements may be left out, but not be in another order.
WPT = tuple("ele time magvar geoidheight name cmt desc src link sym type fix sat hdop extensions".split())
SEQUENCES: dict[str, tuple[str, ...]] = {
    "gpx": tuple("metadata wpt rte trk extensions".split()),
    "metadata": tuple("name desc author copyright link time keywords bounds extensions".split()),
    "wpt": WPT,
    "rtept": WPT,
    "rte": tuple("name cmt desc src link number type extensions rtept".split()),
}
TEXT = {"name", "cmt", "desc", "type", "number"}


def assert_is_gpx(element: Xml.Element) -> None:
    """The element and all below it are as the schema has them."""
    assert element.tag.startswith(NAMESPACE)
    tag = element.tag.removeprefix(NAMESPACE)
    if tag in TEXT:
        assert not list(element) and not element.attrib
        assert tag != "number" or int(element.text or "") >= 0
        return
    children = [child.tag.removeprefix(NAMESPACE) for child in element]
    order = [SEQUENCES[tag].index(child) for child in children]
    assert order == sorted(order)
    if tag != "gpx":
        repeated = {child for child in children if children.count(child) > 1}
        assert repeated <= {"rtept"}
    if tag in ("wpt", "rtept"):
        assert set(element.attrib) == {"lat", "lon"}
        assert -90 <= float(element.attrib["lat"]) <= 90
        assert -180 <= float(element.attrib["lon"]) <= 180
    for child in element:
        assert_is_gpx(child)


def assert_is_gpx_file(text: str) -> None:
    """The whole file is as the schema has it."""
    root = Xml.fromstring(text)
    assert root.tag == f"{NAMESPACE}gpx"
    assert root.attrib["version"] == "1.1" and root.attrib["creator"]
    assert_is_gpx(root)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("<cmt>0 s</cmt>", "<cmt>0 s</cmt><time>0</time>"), ('lat="51', 'lat="91'), ("<number>1<", "<number>-1<")],
)
def test_the_check_of_the_structure_can_say_no(plan, right, wrong):
    text = gpx_file(plan)
    assert_is_gpx_file(text)
    with pytest.raises(AssertionError):
        assert_is_gpx_file(text.replace(right, wrong))


@given(st.data())
def test_gpxpy_reads_what_was_planned(any_plan, data):
    plan = any_plan(data)
    text = gpx_file(plan)
    assert_is_gpx_file(text)
    read = gpxpy.parse(text, version="1.1")
    assert read.creator == "maipp" and (read.name or "") == plan.title
    assert [route.name for route in read.routes] == [route.name for route in plan.routes]
    for found, route in zip(read.routes, plan.routes, strict=True):
        places = [(point.longitude, point.latitude) for point in found.points]
        np.testing.assert_allclose(places, route.points, rtol=0, atol=0.51e-7)
        assert [point.name for point in found.points] == [f"{route.name} {i}" for i in range(len(places))]
    measured = np.vstack([route.measurements for route in plan.routes])
    places = np.reshape([(point.longitude, point.latitude) for point in read.waypoints], (-1, 2))
    np.testing.assert_allclose(places, measured, rtol=0, atol=0.51e-7)


def test_gpxpy_writes_the_same_content_back(plan):
    read = gpxpy.parse(gpx_file(plan), version="1.1")
    assert gpxpy.parse(read.to_xml(version="1.1")).to_xml() == read.to_xml()
    assert read.routes[0].description == "3673.7 m at 1.2 m/s"


def test_the_file_is_as_agreed(plan):
    assert gpx_file(plan) == GOLDEN.read_text(encoding="utf-8")


def test_metres_are_refused(plan_in_metres):
    with pytest.raises(InputError, match="needs longitudes and latitudes"):
        gpx_file(plan_in_metres)
