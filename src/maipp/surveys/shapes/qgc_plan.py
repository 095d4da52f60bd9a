"""QGroundControl's .plan files: the fence's polygons and circles, the polygons of survey items, the planned home.

The format is that of QGroundControl's developer guide (plan version 1, fence versions 1 and 2): positions are latitude
first, angles in degrees, radii in metres.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from maipp.files import read_text
from maipp.geo import WGS84, local_crs, transform
from maipp.records import read_json, show
from maipp.surveys.shapes.drawing import Drawing, Rings, drawing_of, wrong

_GIVE = "a plan with an inclusion fence around the area, or with a survey item"
_CIRCLE = 48  # vertices of a circle


def load_plan(path: Path) -> Drawing:
    """What a plan draws: its inclusion fences are the area, or without any the polygons of its survey items.

    Exclusion fences must not be entered. Raises `InputError` naming the file and the place of what is wrong.
    """
    source = str(path)
    content = read_json(read_text(path, "plan", "a QGroundControl plan"), source).value
    if not isinstance(content, dict) or content.get("fileType") != "Plan":
        wrong(source, "is no QGroundControl plan (its fileType is not Plan)")
    fence, mission = (_mapping(content.get(key), f"{source}: {key}") for key in ("geoFence", "mission"))
    fences = [*_fences(fence, f"{source}: geoFence")]
    surveys = [*_surveys(mission, f"{source}: mission")]
    notes = []
    if surveys and any(each.closed is False for each in fences):
        notes.append(f"{source}: the inclusion fence is the area; the polygons of survey items are left out")
        surveys = []
    drawing = drawing_of(source, [*fences, *surveys], (), _GIVE)
    return drawing._replace(notes=(*drawing.notes, *notes), home=_home(mission, f"{source}: mission"))


def _fences(fence: dict[str, Any], where: str) -> Iterator[Rings]:
    for index, polygon in enumerate(_list(fence, "polygons", where)):
        at = f"{where}: polygons[{index}]"
        content = _mapping(polygon, at)
        yield _rings(content.get("polygon"), at, not content.get("inclusion", True))
    if fence.get("polygon"):  # as version 1 has its one inclusion fence
        yield _rings(fence["polygon"], f"{where}: polygon", False)
    for index, circle in enumerate(_list(fence, "circles", where)):
        at = f"{where}: circles[{index}]"
        content = _mapping(circle, at)
        inner, closed = _mapping(content.get("circle"), f"{at}: circle"), not content.get("inclusion", True)
        yield Rings(at, [_circle(_place(inner.get("center"), at), inner.get("radius"), closed, at)], WGS84, "", closed)


def _surveys(mission: dict[str, Any], where: str) -> Iterator[Rings]:
    """The polygons of survey, corridor and structure items; old plans hold those of a survey in the item itself."""
    for index, item in enumerate(_list(mission, "items", where)):
        if isinstance(item, dict) and item.get("type") == "ComplexItem" and item.get("polygon"):
            yield _rings(item["polygon"], f"{where}: items[{index}]: polygon", False)


def _rings(positions: object, where: str, closed: bool) -> Rings:
    if not isinstance(positions, list):
        wrong(where, f"{show(positions)} is no list of [latitude, longitude]")
    return Rings(where, [[_place(each, where) for each in positions]], WGS84, "", closed)


def _circle(centre: list[float], radius: object, closed: bool, where: str) -> list[list[float]]:
    """A polygon for a circle, outside of it where it is closed and inside where not."""
    if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0 < radius < 1e6:
        wrong(where, f"the radius is {show(radius)}; give metres above 0")
    angles = np.linspace(0.0, 2 * np.pi, _CIRCLE, endpoint=False)
    reach = radius / math.cos(math.pi / _CIRCLE) if closed else radius
    around = reach * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return transform(around, local_crs((centre[0], centre[1])), WGS84, where).tolist()


def _place(position: object, where: str) -> list[float]:
    """Longitude and latitude of a position as plans write it, latitude first."""
    if not isinstance(position, list) or len(position) < 2 or not all(map(_is_number, position[:2])):
        wrong(where, f"{show(position)} is no position; give [latitude, longitude]")
    latitude, longitude = position[:2]
    if not (abs(latitude) <= 90 and abs(longitude) <= 360):  # false for NaN as well
        wrong(where, f"{show(position)} is no [latitude, longitude] in degrees")
    return [float(longitude), float(latitude)]


def _home(mission: dict[str, Any], where: str) -> tuple[float, float] | None:
    """The planned home; plans that have none hold 0, 0 there, or nothing."""
    home = mission.get("plannedHomePosition")
    if not home:
        return None
    longitude, latitude = _place(home, f"{where}: plannedHomePosition")
    return None if longitude == latitude == 0 else (longitude, latitude)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _mapping(value: object, where: str) -> dict[str, Any]:
    if value is None:
        return {}
    return value if isinstance(value, dict) else wrong(where, f"{show(value)} is no mapping")


def _list(content: dict[str, Any], key: str, where: str) -> list[Any]:
    value = content.get(key) or []
    return value if isinstance(value, list) else wrong(where, f"{key} is {show(value)}; it must be a list")
