"""Mission files: the routes of a team for autopilots, receivers, maps and tables."""

from maipp.missions.files import FORMATS, fence_for, left_out, write_mission_files
from maipp.missions.route_plan import Route, RoutePlan
from maipp.missions.vehicle import Vehicle

__all__ = ["FORMATS", "Route", "RoutePlan", "Vehicle", "fence_for", "left_out", "write_mission_files"]
