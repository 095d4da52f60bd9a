"""What an autopilot must know of the vehicle besides its route."""

import math
from dataclasses import dataclass

from maipp.errors import InputError
from maipp.renamed import renamed

# MAV_TYPE and MAV_AUTOPILOT of MAVLink's common message set. QGroundControl takes boats and rovers for one class.
KINDS = {"boat": 11, "rover": 10, "copter": 2}
AUTOPILOTS = {"ardupilot": 3, "px4": 12}


@dataclass(frozen=True)
class VehicleSettings:
    """The kind of vehicle, its autopilot, and how it is to behave; raises `InputError` for what does not exist.

    `altitude` is in metres above home. A boat or rover needs none and gets 0; a copter must be given one above 0.
    """

    kind: str = "boat"  # boat, rover or copter
    autopilot: str = "ardupilot"  # ardupilot or px4
    altitude: float | None = None  # metres above home, of every waypoint
    fence: bool = True  # give the area and the no-go zones to the autopilot as geofence

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"vehicle {self.kind!r} is not known; give {', '.join(KINDS)}")
        if self.autopilot not in AUTOPILOTS:
            raise InputError(f"autopilot {self.autopilot!r} is not known; give {', '.join(AUTOPILOTS)}")
        if self.altitude is not None and not math.isfinite(self.altitude):
            raise InputError(f"altitude is {self.altitude}; give metres above home")
        if self.flies and not (self.altitude is not None and self.altitude > 0):
            raise InputError("a copter needs an altitude: give metres above home, more than 0")

    @property
    def flies(self) -> bool:
        """Whether it must take off first."""
        return self.kind == "copter"

    @property
    def height(self) -> float:
        """Metres above home of every waypoint."""
        return 0.0 if self.altitude is None else float(self.altitude)


renamed(__name__, Vehicle="VehicleSettings")
