"""The route files of a plan, which replace those of an earlier one together (`maipp.files.staged_folder`)."""

import csv
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from maipp.errors import InputError
from maipp.files import staged_folder, write_atomic
from maipp.renamed import renamed
from maipp.route_files.fences import MOST, Fence, fence_of
from maipp.route_files.file_names import file_stems
from maipp.route_files.geojson import geojson_file
from maipp.route_files.gpx import gpx_file
from maipp.route_files.metres_json import metres_json_file
from maipp.route_files.qgc_plan import plan_file
from maipp.route_files.route_plan import RoutePlan
from maipp.route_files.vehicle_settings import VehicleSettings
from maipp.route_files.waypoints_csv import waypoints_csv_file
from maipp.route_files.waypoints_wpl import wpl_file

FORMATS = ("plan", "waypoints", "gpx", "geojson", "csv")

_NEEDS_WGS84 = {
    "plan": "an autopilot needs longitudes and latitudes",
    "waypoints": "an autopilot needs longitudes and latitudes",
    "gpx": "GPX is in longitudes and latitudes",
    "geojson": "GeoJSON is in longitudes and latitudes (RFC 7946); routes-in-metres.json holds the same in metres",
}


def left_out(plan: RoutePlan, formats: Sequence[str] = FORMATS) -> dict[str, str]:
    """Of these formats the ones that `write_route_files` leaves out for this plan, each with the reason.

    Empty for a geographic plan. Raises `InputError` for a format that does not exist.
    """
    for name in formats:
        if name not in FORMATS:
            raise InputError(f"mission format {name!r} is not known; give {', '.join(FORMATS)}")
    return {} if plan.geographic else {name: _NEEDS_WGS84[name] for name in formats if name in _NEEDS_WGS84}


def write_route_files(
    plan: RoutePlan,
    folder: str | os.PathLike[str],
    *,
    formats: Sequence[str] = FORMATS,
    vehicle: str | VehicleSettings = "boat",
    altitude: float | None = None,
) -> list[Path]:
    """Write the plan in these formats into the folder, and say which were written.

    All files or none, as far as `maipp.files.staged_folder` can see to it.

    One `<robot>.plan` and `<robot>.waypoints` a robot, `routes.gpx`, `routes.geojson` and `waypoints.csv`. `vehicle` is
    its kind ("boat", "rover", "copter"; `altitude` in metres above home) or, for more choices, a `VehicleSettings`. A
    plan in metres gives `waypoints.csv` and, for "geojson", `routes-in-metres.json`; `left_out` says what is missing,
    and why. Files of
    robots that an earlier call wrote for, and that are no longer in the plan, are removed.
    Raises `InputError` for unknown formats and vehicles, if nothing is left to write, and if it cannot be written.
    """
    missing = left_out(plan, formats)
    if isinstance(vehicle, str):
        vehicle = VehicleSettings(vehicle, altitude=altitude)
    elif altitude is not None:
        raise InputError("altitude is given twice; give it in the VehicleSettings only")
    contents: dict[str, str] = {}
    stems = file_stems([route.name for route in plan.routes])
    fence = fence_for(plan, vehicle)
    for name, write in (("plan", partial(plan_file, fence=fence)), ("waypoints", wpl_file)):
        if name in formats and name not in missing:
            for stem, route in zip(stems, plan.routes, strict=True):
                contents[f"{stem}.{name}"] = write(plan, route, vehicle)
    if "gpx" in formats and "gpx" not in missing:
        contents["routes.gpx"] = gpx_file(plan)
    if "geojson" in formats:
        if plan.geographic:
            contents["routes.geojson"] = geojson_file(plan)
        else:
            contents["routes-in-metres.json"] = metres_json_file(plan)
    if "csv" in formats:
        contents["waypoints.csv"] = waypoints_csv_file(plan)
    if not contents:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in missing.items()) or f"give {', '.join(FORMATS)}"
        raise InputError(f"no route file can be written ({reasons})")
    with staged_folder(folder, gone=_of_robots_before(Path(folder), set(stems))) as stage:
        for name, content in contents.items():
            write_atomic(stage / name, content)
    return [Path(folder) / name for name in contents]


def fence_for(plan: RoutePlan, vehicle: VehicleSettings) -> Fence:
    """The fence that the plan's files have for this vehicle; its note says what was lost to the autopilot's limit."""
    return fence_of(plan, MOST[vehicle.autopilot]) if vehicle.fence else Fence(plan.area, plan.no_go)


def _of_robots_before(folder: Path, stems: set[str]) -> list[str]:
    """The names of files of robots that the folder's waypoints.csv has, and that are not among these."""
    try:
        with open(folder / "waypoints.csv", encoding="utf-8", newline="") as file:
            names = dict.fromkeys(row["robot"] for row in csv.DictReader(file))
        before = set(file_stems([name for name in names if name])) - stems
    except (OSError, ValueError, KeyError, csv.Error):
        return []
    return [f"{stem}.{name}" for stem in sorted(before) for name in ("plan", "waypoints")]


renamed(__name__, write_mission_files="write_route_files")
