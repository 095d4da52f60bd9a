"""Where the robots may be: the area without its no-go zones, kept clear of the borders, in one piece, in few vertices.

Everything here is in local metres.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.typing import Float

# The border that planners see is simplified until it has no more vertices than this: each planner tests its legs
# against every edge.
MOST_VERTICES = 400

_FINEST, _COARSEST = 1 / 2000, 1 / 100  # tolerance of the simplification, shares of the area's longest side
_NECK = 1.5e-3  # share of the longest side: half the width of the narrowest passage
_QUADRANT = 16  # segments of a quarter circle in a buffer
_ROUND = 1 / math.cos(math.pi / (4 * _QUADRANT))  # how far a circle of such chords must be blown up to hold the circle
_SPAN = (1.0, 1_000_000.0)  # metres: shortest and longest the longest side of an area may be
_WORTH_TELLING = 0.001  # share of the area from which a part that is lost gets a warning of its own


@dataclass(frozen=True)
class OperatingArea:
    """The region that routes keep to, and the starts in it."""

    region: Polygon  # with islands as holes; a border of it lies `margin` or more inside the true one
    starts: Float[np.ndarray, "s 2"]  # where each robot sets out, and other places of its, inside the region
    margin: float  # metres: least distance of the region from what it must keep out of
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Start:
    """Where a robot sets out, and how to speak of it."""

    place: tuple[float, float]  # local metres
    where: str  # file, line and key, for errors
    name: str  # the robot's
    what: str = "start"  # or its end


@dataclass(frozen=True)
class PlaceNames:
    """Places told in the user's coordinates."""

    frame: GeoReference  # its plane has local metres

    def place(self, point: Point) -> str:
        """The place in the user's coordinates."""
        x, y = self.frame.from_plane(np.array([point.x, point.y])).tolist()
        return f"({x:.6f}, {y:.6f})" if self.frame.geographic else f"({x:.1f}, {y:.1f})"

    def swapped(self, start: Start) -> BaseGeometry | None:
        """Where the start would be if its two coordinates were meant the other way round, local metres."""
        x, y = self.frame.from_plane(np.array(start.place)).tolist()
        if self.frame.geographic and abs(x) > 90:
            return None
        return Point(self.frame.to_plane(np.array([y, x])))


def check_size(bounds: tuple[float, float, float, float], where: str) -> None:
    """Raise `InputError` for an area that is too small or too large for one survey."""
    longest = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    if longest < _SPAN[0]:
        problem = f"is {longest:.3g} m across; give an area of at least {_SPAN[0]:g} m"
        raise InputError(f"{where}: {problem} (degrees? then leave out `metres: true`)")
    if longest > _SPAN[1]:
        raise InputError(f"{where}: is {longest / 1000:.0f} km across; give an area of at most {_SPAN[1] / 1000:g} km")


def operating_area(
    area: BaseGeometry,
    no_go: BaseGeometry,
    starts: list[Start],
    clearance: float,
    where: str,
    told: PlaceNames,
    ashore: float = 5.0,
) -> OperatingArea:
    """The part of the area that the robots can reach from their starts with this clearance from every border.

    The border is simplified inward: the region lies inside the true one, by the clearance and some more for rounding.
    Passages that are too narrow for the clearance close. Starts up to `ashore` metres outside are moved inside. `told`
    puts places into the user's coordinates. Raises
    `InputError` where nothing is left, a start lies outside or has no room, or two starts are in parts that no route
    joins; warns of parts that cannot be reached and of starts that were moved.
    """
    true = shapely.difference(area, no_go)
    if true.area <= 1e-9 * area.area:
        raise InputError(f"{where}: the no-go zones cover all of the area; give some free space")
    west, south, east, north = area.bounds
    longest = max(east - west, north - south)
    box = shapely.box(west, south, east, north)
    if clearance == 0 and box.difference(true).area <= 1e-12 * box.area:
        parts, shift = [Polygon(box.exterior)], 0.0
        margin = 0.0
    else:
        parts, shift, margin = _shrink(true, clearance, longest)
        if not parts:
            problem = f"nothing of the area keeps {clearance:g} m clear of its borders and no-go zones"
            raise InputError(f"{where}: {problem}; give a smaller clearance_m or a wider area")
    warnings: list[str] = []
    homes = [_home(start, area, true, parts, shift, longest, told, ashore) for start in starts]
    for start, home in zip(starts, homes, strict=True):
        if home != homes[0]:
            raise InputError(
                f"{start.where}: {start.name} {start.what}s in a part of the area ({_square(parts[home].area)}) that "
                f"no route joins to the part of {starts[0].name} ({_square(parts[homes[0]].area)}); survey them one by "
                "one, or give a smaller clearance_m"
            )
    region = parts[homes[0]]
    others = [part for index, part in enumerate(parts) if index != homes[0]]
    large = [part for part in others if part.area > _WORTH_TELLING * area.area]
    for part in sorted(large, key=lambda part: -part.area)[:5]:
        place = told.place(part.representative_point())
        warnings.append(f"a part of the area of {_square(part.area)} around {place} cannot be reached; it is left out")
    if len(large) > 5:
        warnings.append(f"{len(large) - 5} more parts of the area cannot be reached; they are left out")
    moved = []
    for start in starts:
        place, distance = _into(region, start.place, longest)
        moved.append(place)
        if distance > 1.0:
            warnings.append(f"{start.name}: the {start.what} is moved {distance:.0f} m, to {told.place(Point(place))}")
    return OperatingArea(region, np.array(moved), margin, tuple(warnings))


def _shrink(true: BaseGeometry, clearance: float, longest: float) -> tuple[list[Polygon], float, float]:
    """The simplified parts of what is left of a region away from its border; how far, and how far at least."""
    tolerance = longest * _FINEST
    # Passages that would be left narrower than this to either side: planners in the plane need that much, and no
    # roadmap would find its way through.
    neck = max(clearance / 2, longest * _NECK)
    while True:
        # The simplified border may stray back by one tolerance, so one remains for rounding and curved legs.
        shift = clearance + 2 * tolerance
        core = shapely.buffer(true, -(shift + neck) * _ROUND, quad_segs=_QUADRANT)
        opened = shapely.buffer(core, neck, quad_segs=_QUADRANT)
        parts = [part for part in shapely.get_parts(opened) if isinstance(part, Polygon)]
        # Islands survive: the simplification keeps the topology, and an island has grown by the shift.
        simple = [part.simplify(tolerance) for part in parts if part.area > (4 * tolerance) ** 2]
        parts = [_valid(part) for part in simple if isinstance(part, Polygon)]
        count = max((shapely.get_num_coordinates(part) for part in parts), default=0)
        if count <= MOST_VERTICES or tolerance >= longest * _COARSEST:
            return parts, shift + neck, clearance + tolerance
        tolerance *= 1.25


def _valid(part: Polygon) -> Polygon:
    """The polygon, or the largest piece of what makes it valid, which lies inside it."""
    if part.is_valid:
        return part
    pieces = [piece for piece in shapely.get_parts(shapely.make_valid(part)) if isinstance(piece, Polygon)]
    return max(pieces, key=lambda piece: piece.area)


def _home(
    start: Start,
    area: BaseGeometry,
    true: BaseGeometry,
    parts: list[Polygon],
    shift: float,
    longest: float,
    told: PlaceNames,
    ashore: float,
) -> int:
    """The index of the part that a start belongs to. Raises `InputError` for a start outside or without room."""
    point = Point(start.place)
    outside = float(true.distance(point))
    near = max(ashore, longest * _FINEST)
    if outside > min(near, longest / 20):
        swapped = told.swapped(start)
        if swapped is not None and true.distance(swapped) <= near:
            raise InputError(f"{start.where}: lies outside the area, but with its two numbers swapped it lies inside")
        far = f"{outside:.3g} m" if outside < 10_000 else f"{outside / 1000:.0f} km"
        lies = "deep inside a no-go zone" if area.covers(point) else "outside the area"
        give = "give a place in the free area" + (", or more ashore_m" if outside <= 1000 else "")
        raise InputError(f"{start.where}: {told.place(point)} lies {far} {lies}; {give}")
    distances = shapely.distance(np.array(parts, object), point)
    home = int(np.argmin(distances))
    # At a straight border the region begins one shift away, in a right-angled corner 1.4 shifts.
    if distances[home] > outside + 2.5 * shift + 1e-6 * longest:
        raise InputError(
            f"{start.where}: {start.name} has no room there: the nearest place that keeps the clearance is "
            f"{distances[home]:.0f} m away; move the start or give a smaller clearance_m"
        )
    return home


def _into(region: Polygon, place: tuple[float, float], longest: float) -> tuple[tuple[float, float], float]:
    """The nearest place that is inside the region by more than single precision rounds, and how far it is, metres."""
    point = Point(place)
    inner = shapely.buffer(region, -1e-6 * longest, join_style="mitre")
    if inner.is_empty:
        inner = region
    if inner.covers(point):
        return place, 0.0
    nearest = shapely.shortest_line(inner, point)
    x, y = shapely.get_coordinates(nearest)[0].tolist()
    return (x, y), float(np.hypot(x - place[0], y - place[1]))


def _square(area: float) -> str:
    return f"{area:.0f} m2" if area < 1e6 else f"{area / 1e6:.4g} km2"


def as_region(polygons: Sequence[BaseGeometry]) -> BaseGeometry:
    """The union of polygons; empty without any."""
    return shapely.union_all(polygons) if polygons else MultiPolygon()
