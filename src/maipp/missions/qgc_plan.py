"""QGroundControl's plan files: the mission of one robot with its geofence.

The format is QGroundControl's own (its developer guide, "Plan File Format"), with version 1 of the file, 2 of the
mission and 2 of the fence; commands, frames and their parameters are MAVLink's (common message set).
"""

from typing import Any

from maipp.errors import InputError
from maipp.missions.decimals import counterclockwise, rounded
from maipp.missions.route_plan import Ring, Route, RoutePlan
from maipp.missions.vehicle import AUTOPILOTS, KINDS, Vehicle
from maipp.records import pretty

# MAV_CMD
_WAYPOINT, _TAKEOFF, _CHANGE_SPEED = 16, 22, 178
# MAV_FRAME: for commands without a place, and for places whose altitude counts from home.
_NO_PLACE, _ABOVE_HOME = 2, 3
_RELATIVE = 1  # QGroundControl's altitude mode: above home
_GROUND_SPEED, _KEEP_THROTTLE = 1, -1


def plan_file(plan: RoutePlan, route: Route, vehicle: Vehicle | None = None) -> str:
    """The text of the .plan file of one robot of the plan.

    Take-off (copters only), speed, and every vertex as a waypoint. There is no return to launch, which goes straight
    and knows no no-go zone: a route that ends at home has the way there. The fence holds the area as inclusion and the
    no-go zones as exclusion polygons. Raises `InputError` for a plan in metres.
    """
    if not plan.geographic:
        raise InputError("a .plan file needs longitudes and latitudes (WGS84); this plan is in metres")
    vehicle = vehicle or Vehicle()
    points = rounded(route.points, geographic=True)
    (longitude, latitude), speed = points[0], float(route.speed)
    items = [_change_speed(speed), *(_at(_WAYPOINT, point, vehicle.height) for point in points)]
    if vehicle.flies:  # before the speed: some ArduPilot versions set their own at take-off
        items.insert(0, _at(_TAKEOFF, points[0], vehicle.height))
    fences = [_polygon(plan.area, inclusion=True), *(_polygon(zone, inclusion=False) for zone in plan.no_go)]
    content = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOTS[vehicle.autopilot],
            "vehicleType": KINDS[vehicle.kind],
            "cruiseSpeed": speed,
            "hoverSpeed": speed,
            "globalPlanAltitudeMode": _RELATIVE,
            # The altitude of home above sea level is not known; the autopilot sets its own home when it is armed.
            "plannedHomePosition": [latitude, longitude, 0.0],
            "items": [{**item, "doJumpId": number} for number, item in enumerate(items, start=1)],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": fences if vehicle.fence else []},
        "rallyPoints": {"version": 2, "points": []},
    }
    return pretty(content) + "\n"


def _change_speed(speed: float) -> dict[str, Any]:
    return _item(_CHANGE_SPEED, _NO_PLACE, [_GROUND_SPEED, speed, _KEEP_THROTTLE, 0, 0, 0, 0])


def _at(command: int, point: list[float], altitude: float) -> dict[str, Any]:
    """A command at a place: no hold, the autopilot's own acceptance radius, no heading asked for."""
    longitude, latitude = point
    item = _item(command, _ABOVE_HOME, [0, 0, 0, None, latitude, longitude, altitude])
    return item | {"Altitude": altitude, "AltitudeMode": _RELATIVE, "AMSLAltAboveTerrain": None}


def _item(command: int, frame: int, parameters: list[Any]) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": parameters, "autoContinue": True}


def _polygon(ring: Ring, *, inclusion: bool) -> dict[str, Any]:
    clockwise = rounded(counterclockwise(ring)[::-1], geographic=True)
    return {
        "version": 1,
        "inclusion": inclusion,
        "polygon": [[latitude, longitude] for longitude, latitude in clockwise],
    }
