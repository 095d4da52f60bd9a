"""`--vehicle mavlink`: a vehicle with an autopilot of ArduPilot or PX4, over MAVLink 2 (extra `mavlink`)."""

from maipp.fleet.mavlink.making import make

__all__ = ["make"]
