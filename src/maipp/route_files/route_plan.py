"""The routes of a team as route files need them: in the person's own coordinates, checked."""

import unicodedata
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Float
from shapely import Polygon, is_valid_reason

from maipp.errors import InputError

Ring = Float[np.ndarray, "v 2"]

# Control characters, surrogates and line separators have no place in a name, and XML cannot hold most of them.
_NOT_IN_NAMES = ("Cc", "Cs", "Zl", "Zp")
_NOT_XML = ("\ufffe", "\uffff")
# Longitude may jump by at most this between neighbours: a longer way round would be the shorter way on the globe.
_HALF_TURN = 180.0
# Metres, seconds: more than any survey on earth needs, and little enough for every format to write all digits.
_LARGEST = 1e9


@dataclass(frozen=True, eq=False)
class Route:
    """The route of one robot: where it turns, when, how fast it goes, and where it measures.

    Coordinates are those of the `RoutePlan` that the route is part of: (longitude, latitude) in degrees, or metres.
    Construction copies everything to read-only float64 arrays. Raises `InputError` for a name or number that no file
    could hold, no points, times that fall, and a speed that is not above 0.
    """

    # Shapes are checked below, not annotated: a person whose numbers have others must be told so in words.
    name: str
    points: np.ndarray  # (k, 2) float64, vertices, the start first
    times: np.ndarray  # (k,) float64, seconds from the start of the survey at each vertex
    speed: float  # metres per second
    measurements: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))  # (n, 2) float64, places, in order
    home: np.ndarray | None = None  # (2,) float64, where it is to end; None: anywhere

    def __post_init__(self) -> None:
        check_text(self.name, "the name of a robot")
        if not self.name or self.name != self.name.strip():
            raise InputError(
                f"robot name {self.name!r}: give a name that neither is empty nor begins or ends in a space"
            )
        where = f"robot {self.name!r}"
        points = places(self.points, f"{where}: points")
        if not len(points):
            raise InputError(f"{where}: no points; a route has at least its start")
        times = _numbers(self.times, f"{where}: times", (len(points),))
        if (times < 0).any() or (np.diff(times) < 0).any():
            raise InputError(f"{where}: times must not fall, nor begin below 0 (seconds from the start)")
        speed = _numbers(self.speed, f"{where}: speed", ()).item()
        if speed <= 0:
            raise InputError(f"{where}: speed is {speed:g}; give metres per second above 0")
        measurements = places(self.measurements, f"{where}: measurements")
        if self.home is not None:
            object.__setattr__(self, "home", _numbers(self.home, f"{where}: home", (2,)))
        for name, value in (("points", points), ("times", times), ("speed", speed), ("measurements", measurements)):
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False)
class RoutePlan:
    """The routes of all robots, with the area they survey and the zones they keep out of.

    Rings are kept open (the first vertex is not repeated at the end), whichever way they were given.
    Raises `InputError` for no robots, two of one name, degrees out of range or across the 180th meridian, and rings
    that are no simple polygon.
    """

    title: str
    routes: tuple[Route, ...]
    area: np.ndarray  # (v, 2) float64, boundary of the surveyed area
    no_go: tuple[np.ndarray, ...]  # (v, 2) float64 each, zones to keep out of
    geographic: bool  # True: (longitude, latitude), degrees, WGS84; False: metres (x east, y north) of a local frame
    quantity: str | None = None  # what is measured
    unit: str | None = None  # its unit

    def __post_init__(self) -> None:
        for text, what in ((self.title, "the title"), (self.quantity, "the quantity"), (self.unit, "the unit")):
            if text is not None:
                check_text(text, what)
        object.__setattr__(self, "routes", tuple(self.routes))
        object.__setattr__(self, "area", ring(self.area, "area"))
        zones = tuple(ring(zone, f"no-go zone {i + 1}") for i, zone in enumerate(self.no_go))
        object.__setattr__(self, "no_go", zones)
        if not self.routes:
            raise InputError("no routes; a plan has at least one robot")
        names = [unicodedata.normalize("NFC", route.name) for route in self.routes]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"robot {name!r}: {names.count(name)} robots have this name; give each its own")
        if self.geographic:
            self._check_degrees()

    def _check_degrees(self) -> None:
        lines = [("area", np.vstack([self.area, self.area[:1]]))]
        lines += [(f"no-go zone {i + 1}", np.vstack([zone, zone[:1]])) for i, zone in enumerate(self.no_go)]
        lines += [(f"robot {route.name!r}: points", route.points) for route in self.routes]
        spots = [(f"robot {route.name!r}: measurements", route.measurements) for route in self.routes]
        for what, points in lines + spots:
            if len(wrong := np.flatnonzero((np.abs(points) > (180.0, 90.0)).any(axis=1))):
                longitude, latitude = points[wrong[0]]
                raise InputError(
                    f"{what}[{wrong[0]}]: ({longitude:g}, {latitude:g}) is no (longitude, latitude) in degrees; "
                    "longitudes go from -180 to 180, latitudes from -90 to 90"
                )
        for what, points in lines:
            if (np.abs(np.diff(points[:, 0])) > _HALF_TURN).any():
                raise InputError(f"{what}: crosses the 180th meridian, which route files cannot show; use metres")


def check_text(text: Any, what: str) -> None:
    """Raises `InputError` if this is not text that every file format can hold on one line."""
    if not isinstance(text, str):
        raise InputError(f"{what} is {type(text).__name__}; give a text")
    for character in text:
        if unicodedata.category(character) in _NOT_IN_NAMES or character in _NOT_XML:
            raise InputError(
                f"{what}: {text!r} holds the character U+{ord(character):04X}; give one line of plain text"
            )


def places(value: Any, what: str) -> Float[np.ndarray, "n 2"]:
    """The positions as read-only float64, perhaps none; `InputError` unless they are pairs of finite numbers."""
    if np.size(value) == 0:
        value = np.empty((0, 2))
    return _numbers(value, what, (None, 2))


def ring(value: Any, what: str) -> Ring:
    """The vertices of the polygon, open; `InputError` unless it is simple and encloses an area."""
    vertices = places(value, what)
    if len(vertices) > 1 and (vertices[0] == vertices[-1]).all():
        vertices = vertices[:-1]
    if len(np.unique(vertices, axis=0)) < 3:
        raise InputError(f"{what}: {len(vertices)} vertices; a polygon has at least 3 that differ")
    polygon = Polygon(vertices)
    if not polygon.is_valid or not polygon.area > 0:
        reason = is_valid_reason(polygon) if not polygon.is_valid else "it encloses nothing"
        raise InputError(f"{what}: no simple polygon: {reason}")
    return vertices


def _numbers(value: Any, what: str, shape: tuple[int | None, ...]) -> Float[np.ndarray, "..."]:
    def wrong(problem: str) -> NoReturn:
        raise InputError(f"{what}: {problem}")

    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        wrong("not a table of numbers")
    if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        meant = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
        wrong(f"has shape {array.shape}; it must be {meant}")
    if not np.isfinite(array).all():
        at = np.argwhere(~np.isfinite(array))[0].tolist()
        wrong(f"is {array[tuple(at)]} at {at}; all numbers must be finite")
    if array.size and np.abs(array).max() > _LARGEST:
        wrong(f"holds {array.flat[np.abs(array).argmax()]:g}; no number may be beyond {_LARGEST:g}")
    array.setflags(write=False)
    return array
