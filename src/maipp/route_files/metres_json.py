"""The plan as JSON in metres, where it has no place on the globe; marked so that nobody takes it for GeoJSON."""

from maipp.errors import InputError
from maipp.records import pretty
from maipp.route_files.decimals import rounded, seconds
from maipp.route_files.distance import distances
from maipp.route_files.route_plan import RoutePlan

SCHEMA = "maipp.routes-in-metres/1"


def metres_json_file(plan: RoutePlan) -> str:
    """The text of the JSON file: what the GeoJSON file of a geographic plan holds. `InputError` for one in degrees."""
    if plan.geographic:
        raise InputError("this plan is in longitudes and latitudes; write it as GeoJSON")
    content = {
        "schema": SCHEMA,
        "note": "not GeoJSON: coordinates are metres (x east, y north) of a local frame, not longitude and latitude",
        "title": plan.title,
        "quantity": plan.quantity,
        "unit": plan.unit,
        "area": rounded(plan.area, geographic=False),
        "no_go": [rounded(zone, geographic=False) for zone in plan.no_go],
        "routes": [
            {
                "robot": route.name,
                "speed_m_s": float(route.speed),
                "points": rounded(route.points, geographic=False),
                "times_s": seconds(route.times),
                "distances_m": [round(metres, 2) for metres in distances(route.points, geographic=False).tolist()],
                "measurements": rounded(route.measurements, geographic=False),
            }
            for route in plan.routes
        ],
    }
    return pretty(content) + "\n"
