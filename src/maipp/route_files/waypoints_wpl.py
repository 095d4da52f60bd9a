"""Waypoint files (QGC WPL 110), which Mission Planner, MAVProxy and APM Planner load: the mission of one robot."""

from maipp.errors import InputError
from maipp.route_files.qgc_plan import MissionItem, mission_items
from maipp.route_files.route_plan import Route, RoutePlan
from maipp.route_files.vehicle_settings import VehicleSettings

_WAYPOINT, _ABOVE_SEA = 16, 0  # MAV_CMD, and the MAV_FRAME of altitudes above sea level


def wpl_file(plan: RoutePlan, route: Route, vehicle: VehicleSettings | None = None) -> str:
    """The text of the file: a line for home, then one for each command, fields between tabs.

    The format knows neither fences nor rally points. Raises `InputError` for a plan in metres.
    """
    if not plan.geographic:
        raise InputError("a .waypoints file needs longitudes and latitudes (WGS84); this plan is in metres")
    (longitude, latitude), vehicle = route.points[0].tolist(), vehicle or VehicleSettings()
    home = MissionItem(_WAYPOINT, _ABOVE_SEA, (0.0, 0.0, 0.0, 0.0, latitude, longitude, 0.0))
    lines = ["QGC WPL 110"]
    for index, each in enumerate([home, *mission_items(route, vehicle)]):
        numbers = [f"{0.0 if value is None else float(value):.8f}" for value in each.parameters]
        # Its number, whether it is the current one, frame, command, seven parameters, whether to go on by itself.
        fields = [index, int(index == 0), each.frame, each.command, *numbers, 1]
        lines.append("\t".join(map(str, fields)))
    return "\n".join(lines) + "\n"
