"""Mission files: the routes of a team for autopilots, receivers, maps and tables."""

from maipp.missions.files import FORMATS, left_out, write_mission_files
from maipp.missions.route_plan import Route, RoutePlan
from maipp.missions.vehicle import Vehicle

__all__ = ["FORMATS", "Route", "RoutePlan", "Vehicle", "left_out", "write_mission_files"]
