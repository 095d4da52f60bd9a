"""Route files: the routes of a team for autopilots, receivers, maps and tables."""

from maipp.renamed import renamed
from maipp.route_files.route_plan import Route, RoutePlan
from maipp.route_files.vehicle_settings import VehicleSettings
from maipp.route_files.writer import FORMATS, fence_for, left_out, write_route_files

__all__ = ["FORMATS", "Route", "RoutePlan", "VehicleSettings", "fence_for", "left_out", "write_route_files"]


renamed(__name__, Vehicle="VehicleSettings", write_mission_files="write_route_files")
