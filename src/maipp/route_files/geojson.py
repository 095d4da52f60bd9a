"""GeoJSON (RFC 7946): routes, measurements, area and no-go zones for maps and GIS programs."""

from typing import Any

from maipp.errors import InputError
from maipp.records import pretty
from maipp.route_files.decimals import counterclockwise, rounded, seconds
from maipp.route_files.distance import distances
from maipp.route_files.route_plan import Ring, Route, RoutePlan


def geojson_file(plan: RoutePlan) -> str:
    """The text of the GeoJSON file, a FeatureCollection whose features say in `kind` what they are.

    `area` and `no-go` are polygons by the right-hand rule, `route` is a line with the robot's times and distances (a
    point where the robot never leaves its start), `measurement` a point. Coordinates are WGS84, as RFC 7946, section
    4, demands: raises `InputError` for a plan in metres.
    """
    if not plan.geographic:
        raise InputError("GeoJSON is in longitudes and latitudes (WGS84, RFC 7946); this plan is in metres")
    features = [_feature(_polygon(plan.area), kind="area")]
    features += [_feature(_polygon(zone), kind="no-go", number=i) for i, zone in enumerate(plan.no_go, start=1)]
    features += [_route(route) for route in plan.routes]
    about = {"quantity": plan.quantity, "unit": plan.unit}
    for route in plan.routes:
        for number, place in enumerate(rounded(route.measurements, geographic=True), start=1):
            geometry = {"type": "Point", "coordinates": place}
            features.append(_feature(geometry, kind="measurement", robot=route.name, number=number, **about))
    # `name` is no member of RFC 7946, which allows others (section 6.1); GIS programs show it as the layer's name.
    return pretty({"type": "FeatureCollection", "name": plan.title, "features": features}) + "\n"


def _route(route: Route) -> dict[str, Any]:
    points = rounded(route.points, geographic=True)
    moves = len(points) > 1  # a line has two positions or more
    geometry = {"type": "LineString" if moves else "Point", "coordinates": points if moves else points[0]}
    travelled = [round(metres, 2) for metres in distances(route.points, geographic=True).tolist()]
    return _feature(
        geometry,
        kind="route",
        robot=route.name,
        speed_m_s=float(route.speed),
        length_m=travelled[-1],
        times_s=seconds(route.times),
        distances_m=travelled,
    )


def _polygon(ring: Ring) -> dict[str, Any]:
    vertices = rounded(counterclockwise(ring), geographic=True)
    return {"type": "Polygon", "coordinates": [[*vertices, vertices[0]]]}


def _feature(geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}
