"""Of all that a file draws what may be entered: polygons within polygons are islands, named ones are zones."""

from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from maipp.surveys.shapes.drawing import wrong

_WHOLE = 0.999  # share of a polygon that lies in another where it counts as wholly inside: hand-drawn lines cross
_OVERLAP = 1e-3  # share of the smaller of two polygons from which that they overlap is told


class Named(NamedTuple):
    """A polygon, and what its file says of it."""

    polygon: Polygon
    name: str
    closed: bool | None  # whether it must not be entered; None: the file does not say


class Water(NamedTuple):
    """What may be entered, and what not."""

    area: list[BaseGeometry]
    zones: list[Polygon]
    notes: tuple[str, ...]


def water_of(source: str, drawn: list[Named]) -> Water:
    """What a file draws for an area, all in one system of coordinates.

    A polygon that is named so is a no-go zone. Of the others one wholly inside another is an island, one inside that is
    water again. Raises `InputError` where nothing is left to enter.
    """
    notes = []
    if all(each.closed for each in drawn):
        if not all(each.name for each in drawn):
            wrong(source, "draws only what must not be entered; give the polygon of the area")
        notes.append(f"{source}: every polygon is named as a no-go zone; taken as areas")
        drawn = [each._replace(closed=None) for each in drawn]
    zones = [each for each in drawn if each.closed]
    notes += [f"{source}: {each.name!r} is taken as a no-go zone, as its name says" for each in zones if each.name]
    open_ = sorted((each for each in drawn if not each.closed), key=lambda each: -each.polygon.area)
    area: list[BaseGeometry] = []
    depths: list[int] = []
    kept: list[Named] = []
    tree = shapely.STRtree([each.polygon for each in open_])
    place: dict[int, int] = {}  # of those kept, by their number
    for number, each in enumerate(open_):
        around: list[int] = []
        double = False
        for other in sorted(int(k) for k in tree.query(each.polygon) if k < number and int(k) in place):
            share = _inside(each.polygon, open_[other].polygon)
            if share >= _WHOLE and each.polygon.area >= _WHOLE * open_[other].polygon.area:
                notes.append(f"{source}: {_called(each)} is there twice; taken once")
                double = True
                break
            if share >= _WHOLE:
                around.append(place[other])
            elif share > _OVERLAP:
                notes.append(f"{source}: {_called(each)} overlaps {_called(open_[other])}; taken as one area")
        if double:
            continue
        place[number] = len(kept)
        kept.append(each)
        depths.append(len(around))
        area.append(each.polygon)
        if len(around) % 2:
            inner = max(around, key=lambda k: depths[k])
            notes.append(f"{source}: {_called(each)} lies wholly inside {_called(kept[inner])}; taken as an island")
            for outer in around:
                if depths[outer] % 2 == 0 and depths[outer] == len(around) - 1:
                    area[outer] = shapely.difference(area[outer], each.polygon)
    return Water(
        [each for each, depth in zip(area, depths, strict=True) if depth % 2 == 0],
        [each.polygon for each in zones],
        tuple(notes),
    )


def _inside(polygon: Polygon, other: Polygon) -> float:
    """The share of a polygon that lies in another one; neither need be valid in full."""
    shared = shapely.intersection(polygon, other).area
    return float(np.clip(shared / max(polygon.area, 1e-300), 0.0, 1.0))


def _called(each: Named) -> str:
    return repr(each.name) if each.name else "a polygon"
