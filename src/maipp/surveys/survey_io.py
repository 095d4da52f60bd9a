"""Mission files: YAML read to a `MissionFile`, every complaint on one line with file, line and key (docs/mission.md)."""

import dataclasses
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from maipp.errors import InputError
from maipp.files import read_text
from maipp.geo import WGS84, Crs, read_crs
from maipp.records import FieldError, Misfit, Value, expected, fit, read_yaml, show
from maipp.records.kinds import Each
from maipp.route_files.vehicle_settings import VehicleSettings
from maipp.surveys import mission_file as records
from maipp.surveys.mission_file import (
    AREA,
    Metres,
    MissionFile,
    Pair,
    RasterArea,
    Rehearsal,
    RobotSpec,
    SampleFile,
    Share,
    Text,
)
from maipp.surveys.shapes import Drawing, Rings, load_drawing, polygons_in

KEYS = tuple(key for key in MissionFile.__dataclass_fields__ if key not in ("source", "lines", "return_home"))
ROBOT_KEYS = tuple(records.RobotKeys.__dataclass_fields__)
KERNEL_KEYS = tuple(records.KernelSpec.__dataclass_fields__)
SAMPLE_KEYS = tuple(key for key in SampleFile.__dataclass_fields__ if key != "where")
REHEARSAL_KEYS = tuple(Rehearsal.__dataclass_fields__)
VEHICLE_KEYS = tuple(records.VehicleKeys.__dataclass_fields__)
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
_MOST_ROBOTS = 100
_End = Literal["start"] | Pair | Each[Pair]
_Readers = dict[str, Callable[[Value], Any]]


def load_survey(path: str | os.PathLike[str]) -> MissionFile:
    """The survey in a mission file; paths in it are relative to its folder.

    Raises `InputError` with the file, the line and the key of what is wrong, that other files it names hold included.
    """
    return parse_survey(read_text(path, "mission", "a YAML file"), source=str(path), folder=Path(path).parent)


def parse_survey(text: str, *, source: str = "mission", folder: Path = Path()) -> MissionFile:
    """The survey in YAML text; errors name `source`, relative paths start from `folder`."""
    root = read_yaml(text, source, empty="`maipp survey --new` prints one to start from")
    metres = root["metres"].fit(bool) if "metres" in root else False
    crs = _crs(root["crs"]) if "crs" in root else None
    if metres and crs is not None and crs.metres != 1.0:
        root["crs"].wrong(f"{crs} has no metres, but metres: true says so; leave out one of the two")
    axes = "[x, y]" if metres or (crs is not None and not crs.geographic) else "[longitude, latitude] in degrees"
    # GeoJSON is in WGS84 by its own rules; people who plan in metres write it in metres.
    geojson = None if metres else WGS84
    readers: _Readers = {
        "crs": _crs,
        "raster": lambda value: _file(value, folder, "the path of a raster"),
        "file": lambda value: _file(value, folder, "the path of a file"),
        "start": lambda value: value.fit(Pair, f"a start; give {axes}"),
        "end": lambda value: value.fit(_End, f"an end; give start, {axes}, or a list of such"),
        "reserve": _share,
        "track": lambda value: _file(value, folder, "the path of a CSV or GPX file"),
    }
    survey = root.record(
        MissionFile,
        readers
        | {
            "area": lambda value: _area(value, folder, geojson, readers),
            "no_go": lambda value: _zones(value, folder, geojson, readers),
            "robots": lambda value: _robots(value, root["measurement_spacing_m"].fit(Metres), readers),
            "samples": lambda value: _samples(value, readers),
            "vehicle": _vehicle,
            "scenario": lambda value: {key: value[key].value for key in value.mapping(SCENARIO_KEYS) if key in value},
            "rehearsal": lambda value: _rehearsal(value, folder, readers),
        },
        source=source,
        lines=root.lines,
        return_home=_returns(root),
    )
    for robot in survey.robots:
        if robot.start is None and (isinstance(survey.area, RasterArea) or survey.area.home is None):
            raise FieldError("start", f"missing; give {axes}", f"{robot.where}.")
    if survey.below and survey.threshold is None:
        root["below"].wrong("says on which side of the threshold values matter, but there is none; give threshold")
    return survey if "name" in root else dataclasses.replace(survey, name=Path(source).stem or survey.name)


def _file(value: Value, folder: Path, allowed: str) -> Path:
    path = folder / value.fit(Text, allowed)
    try:
        found = path.is_file()
    except (OSError, ValueError):  # a name too long, or with characters that no name has
        found = False
    return path if found else value.wrong(f"no file {path}")


def _share(value: Value) -> float:
    """A share of the budget, as a number or with a percent sign."""
    text = value.value.strip() if isinstance(value.value, str) else ""
    try:
        return fit(Share, float(text[:-1]) / 100 if text.endswith("%") else value.value)
    except (Misfit, ValueError):
        return value.unfit(expected(Share))


def _crs(value: Value) -> Crs:
    """The coordinate reference system that a key names."""
    crs = read_crs(value.fit(Text, "a coordinate reference system, such as EPSG:25833"), value.place)
    return crs if crs.located else value.wrong("is no place on Earth; for a plain plane give metres: true")


def _area(value: Value, folder: Path, geojson: Crs | None, readers: _Readers) -> Drawing | RasterArea:
    if not isinstance(value.value, dict) or "type" in value.value or "file" in value.value:
        return _shape(value, folder, geojson, readers)
    keys = value.record(records.RasterAreaKeys, readers)
    if keys.below is not None and keys.above is not None:
        value.wrong("give one of below and above, or none for all cells that hold a value")
    level = keys.above if keys.below is None else keys.below
    return RasterArea(keys.raster, keys.value, level, keys.below is not None, value.place, keys.crs, keys.at)


def _zones(value: Value, folder: Path, geojson: Crs | None, readers: _Readers) -> tuple[Drawing, ...]:
    """The no-go zones: one, or a list of them."""
    zones = [value]
    if isinstance(value.value, list) and not (value.value and all(map(_is_point, value.value))):
        zones = value.items()
    return tuple(_shape(zone, folder, geojson, readers) for zone in zones)


def _is_point(value: object) -> bool:
    try:
        return isinstance(value, list) and bool(fit(Pair, value))
    except Misfit:
        return False


def _shape(value: Value, folder: Path, geojson: Crs | None, readers: _Readers) -> Drawing:
    """The polygons that a path, GeoJSON or a list of positions gives."""
    if isinstance(value.value, str):
        return load_drawing(_file(value, folder, AREA), geojson)
    if isinstance(value.value, dict) and "file" in value.value:
        keys = value.record(records.ShapeKeys, readers)
        return load_drawing(keys.file, geojson, layer=keys.layer, crs=keys.crs)
    if isinstance(value.value, dict):
        return polygons_in(value.value, value.place)
    return (
        Drawing(value.place, (Rings(value.place, [value.value]),))
        if isinstance(value.value, list)
        else value.unfit(AREA)
    )


def _robots(value: Value, spacing: float, readers: _Readers) -> tuple[RobotSpec, ...]:
    robots: dict[str, RobotSpec] = {}
    for index, item in enumerate(value.items(1, "a list of robots, one at least")):
        if index >= _MOST_ROBOTS:
            value.wrong(f"has more than {_MOST_ROBOTS} robots; survey with fewer")
        keys = item.record(records.RobotKeys, readers)
        if (keys.budget_m is None) == (keys.budget_minutes is None):
            item.wrong("give one of budget_m and budget_minutes")
        budget = keys.budget_m or (keys.budget_minutes or 0.0) * 60.0 * keys.speed
        reserve = _reserve(item, keys, budget)
        if budget - reserve < spacing:
            given = item["budget_m" if keys.budget_m else "budget_minutes"]
            given.wrong(
                f"{show(given.value)} allows {budget - reserve:.4g} m, less than measurement_spacing_m "
                f"({spacing:g} m), so nothing would be measured; give more budget or a smaller spacing"
            )
        name = keys.name or f"robot-{index + 1}"
        if name in robots:
            (item["name"] if keys.name else item).wrong(
                f"{show(name)} is the name of an earlier robot; give each its own"
            )
        end: Any = keys.end  # one place is a list of one
        end = (end,) if isinstance(end, tuple) and not isinstance(end[0], tuple) else end
        where, end_where = ((item[key] if key in item else item).place for key in ("start", "end"))
        robots[name] = RobotSpec(name, keys.start, budget, keys.speed, end, reserve, where, end_where)
    return tuple(robots.values())


def _reserve(item: Value, keys: records.RobotKeys, budget: float) -> float:
    """What of a robot's budget is not to be spent, metres."""
    given = [key for key in ("reserve", "reserve_m", "reserve_minutes") if getattr(keys, key) is not None]
    if len(given) > 1:
        item.wrong(f"give one of {' and '.join(given)}")
    minutes = (keys.reserve_minutes or 0.0) * 60.0 * keys.speed
    reserve = keys.reserve_m or minutes or (keys.reserve or 0.0) * budget
    if reserve >= budget:
        item[given[0]].wrong(f"{reserve:.4g} m is not below the budget, {budget:.4g} m; give less")
    return reserve


def _vehicle(value: Value) -> VehicleSettings:
    """The vehicle that route files are for: its kind, or a mapping with more of it."""
    given = {"kind": value.value}
    if isinstance(value.value, dict):
        keys = vars(value.record(records.VehicleKeys))
        given = {key.removesuffix("_m"): told for key, told in keys.items() if told is not None}
        given.pop("return_home", None)  # is the robots' business
    elif not isinstance(value.value, str):
        value.unfit("a vehicle; give boat, rover or copter")
    try:
        return VehicleSettings(**given)
    except InputError as error:
        return value.wrong(str(error))


def _returns(root: Value) -> bool:
    """Whether the vehicles are to come home."""
    if "vehicle" not in root or not isinstance(root["vehicle"].value, dict):
        return False
    return root["vehicle"].part(records.VehicleKeys, "return_home") if "return_home" in root["vehicle"] else False


def _samples(value: Value, readers: _Readers) -> SampleFile:
    if isinstance(value.value, str):
        return SampleFile(readers["file"](value), where=value.place)
    file = value.record(SampleFile, readers, where=value.place)
    for key in ("time", "track_time", "offset_s", "lag_s"):
        if key in value and file.track is None:
            value[key].wrong("is for values without positions; give the track they were measured on")
    return file


def _rehearsal(value: Value, folder: Path, readers: _Readers) -> Rehearsal:
    if isinstance(value.value, str):
        return Rehearsal(raster=_file(value, folder, "the path of a raster, or a number of fields"))
    if isinstance(value.value, dict):
        return value.record(Rehearsal, readers)
    return Rehearsal(fields=value.fit(records.Fields))


def is_mission(path: Path) -> bool:
    """Whether the file has keys that only missions have; one that cannot be read is left to the scenario's reader."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError):
        return False
    return re.search(r"""^[{\s"']*(area|robots|measurement_spacing_m)["']?\s*:""", text, re.MULTILINE) is not None
