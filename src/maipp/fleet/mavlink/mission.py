"""One way as a mission that an autopilot follows: its speed, and every waypoint."""

import numpy as np

from maipp.missions.qgc_plan import Command, commands
from maipp.missions.route_plan import Route
from maipp.missions.vehicle import Vehicle
from maipp.typing import Float

_TAKEOFF, _WAYPOINT, _ABOVE_SEA = 22, 16, 0  # MAV_CMD, MAV_FRAME


def items_of(
    home: Float[np.ndarray, "2"], waypoints: Float[np.ndarray, "n 2"], speed: float, vehicle: Vehicle, *, px4: bool
) -> tuple[list[Command], int]:
    """The items, and the number of the first waypoint among them; longitudes and latitudes, metres per second.

    A copter is in the air already. ArduPilot keeps its home as item 0, and does not take this one for it.
    """
    route = Route("way", waypoints, np.zeros(len(waypoints)), speed)
    items = [item for item in commands(route, vehicle) if item.command != _TAKEOFF]
    if not px4:
        longitude, latitude = home.tolist()
        items.insert(0, Command(_WAYPOINT, _ABOVE_SEA, (0.0, 0.0, 0.0, 0.0, latitude, longitude, 0.0)))
    return items, len(items) - len(waypoints)
