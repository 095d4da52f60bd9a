"""Mission files: YAML read to a `Survey`, every complaint on one line with file, line and key (docs/survey.md)."""

import os
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.files import read_text
from maipp.geo import WGS84, Crs, read_crs
from maipp.missions.vehicle import Vehicle
from maipp.scenario_checks import show
from maipp.seeds import LARGEST_SEED
from maipp.surveys.entry import Entry, is_point, read_yaml
from maipp.surveys.geojson import Rings, load_geojson, polygons_in
from maipp.surveys.survey import Kernel, RasterArea, Rehearsal, Robot, SampleFile, Survey

KEYS = (
    "name",
    "area",
    "metres",
    "crs",
    "no_go",
    "clearance_m",
    "robots",
    "measurement_spacing_m",
    "quantity",
    "unit",
    "threshold",
    "below",
    "samples",
    "noise",
    "kernel",
    "communication_range_m",
    "vehicle",
    "planner",
    "planner_options",
    "scenario",
    "rehearsal",
    "seed",
)
ROBOT_KEYS = ("name", "start", "speed", "budget_m", "budget_minutes")
RASTER_AREA_KEYS = ("raster", "value", "below", "above", "crs")
VEHICLE_KEYS = ("kind", "autopilot", "altitude_m", "return_home", "fence")
KERNEL_KEYS = ("length_scale_m", "mean", "std")
SAMPLE_KEYS = ("file", "x", "y", "value", "crs")
REHEARSAL_KEYS = ("raster", "value", "fields", "crs")
# The rest of the scenario follows from the mission.
SCENARIO_KEYS = (
    "grid",
    "nodes",
    "neighbours",
    "beta",
    "interest_rule",
    "virtual_value",
    "belief_capacity",
    "last_leg",
)
DEFAULT_PLANNER = "receding-horizon"
_RINGS = "a GeoJSON file, GeoJSON, or a list of positions around the border"
_MOST_ROBOTS = 100


def load_survey(path: str | os.PathLike[str]) -> Survey:
    """The survey in a mission file; paths in it are relative to its folder.

    Raises `InputError` with the file, the line and the key of what is wrong, that other files it names hold included.
    """
    return parse_survey(read_text(path, "mission", "a YAML file"), source=str(path), folder=Path(path).parent)


def parse_survey(text: str, *, source: str = "mission", folder: Path = Path()) -> Survey:
    """The survey in YAML text; errors name `source`, relative paths start from `folder`."""
    root = read_yaml(text, source)
    keys = root.children(KEYS)
    for required in ("area", "robots", "measurement_spacing_m"):
        if required not in keys:
            root.wrong(f"{required}: missing; `maipp survey --new` prints a mission with all keys")
    metres = keys["metres"].flag() if "metres" in keys else False
    crs = _crs(keys)
    if metres and crs is not None and crs.metres != 1.0:
        keys["crs"].wrong(f"{crs} has no metres, but metres: true says so; leave out one of the two")
    # GeoJSON is in WGS84 by its own rules; people who plan in metres write it in metres.
    geojson = None if metres else WGS84
    threshold = keys["threshold"].number("a number in the unit") if "threshold" in keys else None
    below = keys["below"].flag() if "below" in keys else False
    if below and threshold is None:
        keys["below"].wrong("says on which side of the threshold values matter, but there is none; give threshold")
    spacing = keys["measurement_spacing_m"].positive("a length > 0, in metres")
    robots = _robots(keys["robots"], spacing, metres or (crs is not None and not crs.geographic))
    options = keys["planner_options"] if "planner_options" in keys else None
    if options is not None and not isinstance(options.value, dict):
        options.wrong(f"{show(options.value)} is not a mapping; give lines of `option: value`")
    return Survey(
        source=source,
        name=keys["name"].text("a name") if "name" in keys else (Path(source).stem or "survey"),
        area=_area(keys["area"], folder, geojson),
        no_go=tuple(_zones(keys["no_go"], folder, geojson)) if "no_go" in keys else (),
        metres=metres,
        crs=crs,
        clearance_m=_at_least_0(keys, "clearance_m", "a length >= 0, in metres") or 0.0,
        robots=robots,
        measurement_spacing_m=spacing,
        quantity=keys["quantity"].text("the name of what is measured") if "quantity" in keys else None,
        unit=keys["unit"].text("a unit, such as ug/L") if "unit" in keys else None,
        threshold=threshold,
        below=below,
        samples=_samples(keys["samples"], folder) if "samples" in keys else None,
        noise=_at_least_0(keys, "noise", "a standard deviation >= 0, in the unit"),
        kernel=_kernel(keys["kernel"]) if "kernel" in keys else Kernel(),
        communication_range_m=(
            keys["communication_range_m"].positive("a length > 0, in metres, or null for any distance")
            if "communication_range_m" in keys
            else None
        ),
        vehicle=_vehicle(keys["vehicle"]) if "vehicle" in keys else Vehicle(),
        planner=keys["planner"].text("the name of a planner") if "planner" in keys else DEFAULT_PLANNER,
        planner_options=dict(options.value) if options is not None else {},
        scenario=_scenario(keys["scenario"]) if "scenario" in keys else {},
        rehearsal=_rehearsal(keys["rehearsal"], folder) if "rehearsal" in keys else Rehearsal(),
        seed=keys["seed"].whole(f"a whole number from 0 to {LARGEST_SEED}", 0, LARGEST_SEED) if "seed" in keys else 0,
        lines=root.lines,
    )


def _at_least_0(keys: dict[str, Entry], key: str, allowed: str) -> float | None:
    return keys[key].number(allowed, lambda number: number >= 0) if key in keys else None


def _file(entry: Entry, folder: Path, allowed: str) -> Path:
    path = folder / entry.text(allowed)
    try:
        found = path.is_file()
    except (OSError, ValueError):  # a name too long, or with characters that no name has
        found = False
    return path if found else entry.wrong(f"no file {path}")


def _crs(keys: dict[str, Entry]) -> Crs | None:
    """The coordinate reference system that a key names; None without one."""
    if "crs" not in keys:
        return None
    entry = keys["crs"]
    crs = read_crs(entry.text("a coordinate reference system, such as EPSG:25833"), f"{entry.where}: {entry.key}")
    return crs if crs.located else entry.wrong("is no place on Earth; for a plain plane give metres: true")


def _area(entry: Entry, folder: Path, geojson: Crs | None) -> tuple[Rings, ...] | RasterArea:
    if isinstance(entry.value, dict) and "type" not in entry.value:
        keys = entry.children(RASTER_AREA_KEYS)
        if "raster" not in keys:
            entry.wrong(f"{show(entry.value)} is neither {_RINGS}, nor a raster with a level")
        if "below" in keys and "above" in keys:
            entry.wrong("give one of below and above, or none for all cells that hold a value")
        side = "below" if "below" in keys else "above"
        return RasterArea(
            raster=_file(keys["raster"], folder, "the path of a raster"),
            value=keys["value"].text("the name of an array or column") if "value" in keys else None,
            level=keys[side].number("a level in the raster's unit") if side in keys else None,
            below=side == "below",
            where=f"{entry.where}: {entry.key}",
            crs=_crs(keys),
        )
    return tuple(_shape(entry, folder, geojson))


def _zones(entry: Entry, folder: Path, geojson: Crs | None) -> list[tuple[Rings, ...]]:
    """The no-go zones: one, or a list of them."""
    value = entry.value
    if isinstance(value, list) and not (value and all(is_point(item) for item in value)):
        return [tuple(_shape(item, folder, geojson)) for item in entry.items(0, "a list of zones")]
    return [tuple(_shape(entry, folder, geojson))]


def _shape(entry: Entry, folder: Path, geojson: Crs | None) -> list[Rings]:
    """The polygons that a path, GeoJSON or a list of positions gives."""
    value, where = entry.value, f"{entry.where}: {entry.key}"
    if isinstance(value, str):
        return load_geojson(_file(entry, folder, _RINGS), geojson)
    if isinstance(value, dict):
        return polygons_in(value, where)
    if isinstance(value, list):
        return [Rings(where, [value])]
    return entry.wrong(f"{show(value)} is not {_RINGS}")


def _robots(entry: Entry, spacing: float, plane: bool) -> tuple[Robot, ...]:
    robots: list[Robot] = []
    for index, item in enumerate(entry.items(1, "a list of robots, one at least")):
        if index >= _MOST_ROBOTS:
            entry.wrong(f"has more than {_MOST_ROBOTS} robots; survey with fewer")
        keys = item.children(ROBOT_KEYS)
        for required in ("start", "speed"):
            if required not in keys:
                item.wrong(f"has no {required}; give {', '.join(ROBOT_KEYS[1:4])} (or {ROBOT_KEYS[4]})")
        speed = keys["speed"].number("a speed in m/s, from 0.001 to 1000", lambda v: 1e-3 <= v <= 1e3)
        if ("budget_m" in keys) == ("budget_minutes" in keys):
            item.wrong("give one of budget_m and budget_minutes")
        if "budget_m" in keys:
            key = "budget_m"
            budget = keys[key].positive("a length > 0, in metres")
        else:
            key = "budget_minutes"
            budget = keys[key].positive("a time > 0, in minutes") * 60.0 * speed
        if budget < spacing:
            keys[key].wrong(
                f"{show(keys[key].value)} allows {budget:.4g} m, less than measurement_spacing_m ({spacing:g} m), "
                "so nothing would be measured; give more budget or a smaller spacing"
            )
        axes = "[x, y]" if plane else "[longitude, latitude] in degrees"
        name = keys["name"].text("a name") if "name" in keys else f"robot-{index + 1}"
        if name in (robot.name for robot in robots):
            (keys.get("name") or item).wrong(f"{show(name)} is the name of an earlier robot; give each its own")
        start = keys["start"].point(f"a start; give {axes}")
        robots.append(Robot(name, start, budget, speed, f"{keys['start'].where}: {keys['start'].key}"))
    return tuple(robots)


def _vehicle(entry: Entry) -> Vehicle:
    """The vehicle that mission files are for: its kind, or a mapping with more of it."""
    given: dict[str, Any] = {"kind": entry.value}
    if isinstance(entry.value, dict):
        keys = entry.children(VEHICLE_KEYS)
        given = {key: keys[key].text("a word") for key in ("kind", "autopilot") if key in keys}
        given |= {key: keys[key].flag() for key in ("return_home", "fence") if key in keys}
        if "altitude_m" in keys:
            given["altitude"] = keys["altitude_m"].number("a height above home, in metres")
    elif not isinstance(entry.value, str):
        entry.wrong(f"{show(entry.value)} is no vehicle; give boat, rover or copter")
    try:
        return Vehicle(**given)
    except InputError as error:
        return entry.wrong(str(error))


def _samples(entry: Entry, folder: Path) -> SampleFile:
    where = f"{entry.where}: {entry.key}"
    if isinstance(entry.value, str):
        return SampleFile(_file(entry, folder, "the path of a CSV file"), {}, where)
    keys = entry.children(SAMPLE_KEYS)
    if "file" not in keys:
        entry.wrong("has no file; give the path of a CSV file")
    columns = {key: keys[key].text("the name of a column") for key in ("x", "y", "value") if key in keys}
    return SampleFile(_file(keys["file"], folder, "the path of a CSV file"), columns, where, _crs(keys))


def _kernel(entry: Entry) -> Kernel:
    keys = entry.children(KERNEL_KEYS)
    return Kernel(
        length_scale_m=keys["length_scale_m"].positive("a length > 0, in metres") if "length_scale_m" in keys else None,
        mean=keys["mean"].number("a number in the unit") if "mean" in keys else None,
        std=keys["std"].positive("a standard deviation > 0, in the unit") if "std" in keys else None,
    )


def _scenario(entry: Entry) -> dict[str, Any]:
    """The settings, whose values the scenario itself checks."""
    return {key: item.value for key, item in entry.children(SCENARIO_KEYS).items()}


def _rehearsal(entry: Entry, folder: Path) -> Rehearsal:
    if isinstance(entry.value, str):
        return Rehearsal(raster=_file(entry, folder, "the path of a raster, or a number of fields"))
    if not isinstance(entry.value, dict):
        return Rehearsal(fields=entry.whole("a raster, or a number of fields from 1 to 10000", 1, 10_000))
    keys = entry.children(REHEARSAL_KEYS)
    return Rehearsal(
        raster=_file(keys["raster"], folder, "the path of a raster") if "raster" in keys else None,
        value=keys["value"].text("the name of an array or column") if "value" in keys else None,
        fields=keys["fields"].whole("a number of fields from 1 to 10000", 1, 10_000) if "fields" in keys else 30,
        crs=_crs(keys),
    )
