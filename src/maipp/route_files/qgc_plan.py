"""QGroundControl's plan files: the mission of one robot with its geofence.

The format is QGroundControl's own (its developer guide, "Plan File Format"), with version 1 of the file, 2 of the
mission and 2 of the fence; commands, frames and their parameters are MAVLink's (common message set).
"""

from typing import Any, NamedTuple

from maipp.errors import InputError
from maipp.records import pretty
from maipp.route_files.decimals import counterclockwise, rounded
from maipp.route_files.fences import Fence
from maipp.route_files.route_plan import Ring, Route, RoutePlan
from maipp.route_files.vehicle_settings import AUTOPILOTS, KINDS, VehicleSettings

# MAV_CMD
_WAYPOINT, _TAKEOFF, _CHANGE_SPEED = 16, 22, 178
# MAV_FRAME: for commands without a place, and for places whose altitude counts from home.
_NO_PLACE, _ABOVE_HOME = 2, 3
_RELATIVE = 1  # QGroundControl's altitude mode: above home
_GROUND_SPEED, _KEEP_THROTTLE = 1, -1


class MissionItem(NamedTuple):
    """One item of a mission."""

    command: int  # MAV_CMD
    frame: int  # MAV_FRAME
    parameters: tuple[float | None, ...]  # seven: four of its own, then latitude, longitude and altitude


def mission_items(route: Route, vehicle: VehicleSettings) -> list[MissionItem]:
    """The mission of a robot: take-off (copters only), speed, and every vertex as a waypoint.

    There is no return to launch, which goes straight and knows no no-go zone: a route that ends at home has the way
    there.
    """
    points = rounded(route.points, geographic=True)
    # No hold, the autopilot's own acceptance radius, no heading: PX4 takes nothing for that, ArduPilot looks not at it.
    heading = None if vehicle.autopilot == "px4" else 0.0
    places = [(0, 0, 0, heading, latitude, longitude, vehicle.height) for longitude, latitude in points]
    speed = MissionItem(_CHANGE_SPEED, _NO_PLACE, (_GROUND_SPEED, float(route.speed), _KEEP_THROTTLE, 0, 0, 0, 0))
    items = [speed, *(MissionItem(_WAYPOINT, _ABOVE_HOME, place) for place in places)]
    if vehicle.flies:  # before the speed: some ArduPilot versions set their own at take-off
        items.insert(0, MissionItem(_TAKEOFF, _ABOVE_HOME, places[0]))
    return items


def plan_file(plan: RoutePlan, route: Route, vehicle: VehicleSettings | None = None, fence: Fence | None = None) -> str:
    """The text of the .plan file of one robot of the plan.

    The mission is that of `commands`. The fence, the plan's own if none is given, holds the area as inclusion and the
    no-go zones as exclusion polygons; a robot's home is a rally point. As Mission Planner's reader asks for, cruise
    speeds are whole numbers, and for ArduPilot there are no nulls. Raises `InputError` for a plan in metres.
    """
    if not plan.geographic:
        raise InputError("a .plan file needs longitudes and latitudes (WGS84); this plan is in metres")
    vehicle, fence = vehicle or VehicleSettings(), fence or Fence(plan.area, plan.no_go)
    (longitude, latitude), cruise = rounded(route.points[:1], geographic=True)[0], max(1, round(route.speed))
    fences = [_polygon(fence.area, inclusion=True), *(_polygon(zone, inclusion=False) for zone in fence.zones)]
    homes = [] if route.home is None else rounded(route.home[None], geographic=True)
    content = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOTS[vehicle.autopilot],
            "vehicleType": KINDS[vehicle.kind],
            "cruiseSpeed": cruise,
            "hoverSpeed": cruise,
            "globalPlanAltitudeMode": _RELATIVE,
            # The altitude of home above sea level is not known; the autopilot sets its own home when it is armed.
            "plannedHomePosition": [latitude, longitude, 0.0],
            "items": [_item(number, each) for number, each in enumerate(mission_items(route, vehicle), start=1)],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": fences if vehicle.fence else []},
        "rallyPoints": {"version": 2, "points": [[y, x, vehicle.height] for x, y in homes]},
    }
    return pretty(content) + "\n"


def _item(number: int, item: MissionItem) -> dict[str, Any]:
    told = {
        "type": "SimpleItem",
        "command": item.command,
        "frame": item.frame,
        "params": list(item.parameters),
        "autoContinue": True,
    }
    if item.frame == _ABOVE_HOME:
        altitude = item.parameters[-1]
        told |= {"Altitude": altitude, "AltitudeMode": _RELATIVE, "AMSLAltAboveTerrain": altitude}
    return told | {"doJumpId": number}


def _polygon(ring: Ring, *, inclusion: bool) -> dict[str, Any]:
    clockwise = rounded(counterclockwise(ring)[::-1], geographic=True)
    return {
        "version": 1,
        "inclusion": inclusion,
        "polygon": [[latitude, longitude] for longitude, latitude in clockwise],
    }
