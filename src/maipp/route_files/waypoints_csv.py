"""The vertices of all routes as one CSV table."""

import csv
import io

from maipp.route_files.decimals import DEGREE_DECIMALS, METRE_DECIMALS
from maipp.route_files.distance import distances
from maipp.route_files.route_plan import RoutePlan


def waypoints_csv_file(plan: RoutePlan) -> str:
    """The text of the CSV file: robot, order from 0, position, seconds from the start, metres travelled.

    The position is longitude and latitude with 7 decimals, or x and y in metres with 3.
    """
    decimals = DEGREE_DECIMALS if plan.geographic else METRE_DECIMALS
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    place = ("longitude", "latitude") if plan.geographic else ("x_m", "y_m")
    writer.writerow(("robot", "order", *place, "time_s", "distance_m"))
    for route in plan.routes:
        travelled = distances(route.points, geographic=plan.geographic)
        for order, (point, time, metres) in enumerate(zip(route.points, route.times, travelled, strict=True)):
            x, y = (f"{number:.{decimals}f}" for number in point)
            writer.writerow((route.name, order, x, y, f"{time:.2f}", f"{metres:.2f}"))
    return text.getvalue()
