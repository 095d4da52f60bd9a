"""GPX 1.1: the routes and the places of measurements for GPS receivers and chart plotters."""

from xml.etree import ElementTree as Xml

from maipp.errors import InputError
from maipp.route_files.decimals import rounded, seconds
from maipp.route_files.distance import distances
from maipp.route_files.route_plan import RoutePlan

_NAMESPACE = "http://www.topografix.com/GPX/1/1"


def gpx_file(plan: RoutePlan) -> str:
    """The text of the GPX file: a waypoint for every measurement, then a route for every robot.

    The order of elements is that of the schema. There are no dates in it, for a plan has none; the seconds from the
    start are in each route point's comment. Raises `InputError` for a plan in metres.
    """
    if not plan.geographic:
        raise InputError("a GPX file needs longitudes and latitudes (WGS84); this plan is in metres")
    schema = {
        "xmlns": _NAMESPACE,
        "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
        "xsi:schemaLocation": f"{_NAMESPACE} {_NAMESPACE}/gpx.xsd",
    }
    root = Xml.Element("gpx", {"version": "1.1", "creator": "maipp", **schema})
    _add(Xml.SubElement(root, "metadata"), name=plan.title)
    measured = "measurement" if plan.quantity is None else f"measurement of {plan.quantity}"
    for route in plan.routes:
        for number, place in enumerate(rounded(route.measurements, geographic=True), start=1):
            _add(_place(root, "wpt", place), name=f"{route.name} {number}", desc=measured, type="measurement")
    for number, route in enumerate(plan.routes, start=1):
        element = Xml.SubElement(root, "rte")
        length = distances(route.points, geographic=True)[-1]
        _add(element, name=route.name, desc=f"{length:.1f} m at {route.speed:g} m/s", number=str(number))
        points = zip(rounded(route.points, geographic=True), seconds(route.times), strict=True)
        for order, (place, time) in enumerate(points):
            _add(_place(element, "rtept", place), name=f"{route.name} {order}", cmt=f"{time:.0f} s")
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _place(parent: Xml.Element, tag: str, point: list[float]) -> Xml.Element:
    longitude, latitude = point
    return Xml.SubElement(parent, tag, {"lat": f"{latitude:.7f}", "lon": f"{longitude:.7f}"})


def _add(parent: Xml.Element, **texts: str) -> None:
    for tag, text in texts.items():
        Xml.SubElement(parent, tag).text = text
