"""What an autopilot is given: one way as a mission, its speed and every waypoint; and its fence."""

import numpy as np

from maipp.route_files.decimals import rounded
from maipp.route_files.fences import Fence
from maipp.route_files.qgc_plan import MissionItem, mission_items
from maipp.route_files.route_plan import Route
from maipp.route_files.vehicle_settings import VehicleSettings
from maipp.typing import Float

_TAKEOFF, _WAYPOINT, _ABOVE_SEA = 22, 16, 0  # MAV_CMD, MAV_FRAME
_INCLUSION, _EXCLUSION = 5001, 5002  # MAV_CMD: a vertex of a polygon; the first parameter says how many it has


def fence_items(fence: Fence) -> list[MissionItem]:
    """The vertices of a fence, longitudes and latitudes: of the area, and of the zones in it that are shut out."""
    items = []
    for ring, command in ((fence.area, _INCLUSION), *((zone, _EXCLUSION) for zone in fence.zones)):
        corners = rounded(ring, geographic=True)
        corners = corners[:-1] if corners[0] == corners[-1] else corners
        items += [MissionItem(command, _ABOVE_SEA, (len(corners), 0, 0, 0, y, x, 0)) for x, y in corners]
    return items


def items_of(
    home: Float[np.ndarray, "2"],
    waypoints: Float[np.ndarray, "n 2"],
    speed: float,
    vehicle: VehicleSettings,
    *,
    px4: bool,
) -> tuple[list[MissionItem], int]:
    """The items, and the number of the first waypoint among them; longitudes and latitudes, metres per second.

    A copter is in the air already. ArduPilot keeps its home as item 0, and does not take this one for it.
    """
    route = Route("way", waypoints, np.zeros(len(waypoints)), speed)
    items = [item for item in mission_items(route, vehicle) if item.command != _TAKEOFF]
    if not px4:
        longitude, latitude = home.tolist()
        items.insert(0, MissionItem(_WAYPOINT, _ABOVE_SEA, (0.0, 0.0, 0.0, 0.0, latitude, longitude, 0.0)))
    return items, len(items) - len(waypoints)
