"""No-go zones for planners that move in the plane: borders to stop at, and shortest ways around them.

Made on the host in float64, once per scenario. The zones grow by a small clearance first, so that float32 positions
never decide by chance whether a leg enters one. The corners of what has grown are the places where a shortest way may
turn; ways between all of them (a visibility graph) lead from anywhere to anywhere.
"""

import math
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from maipp.fields.mixture import host_grid
from maipp.roadmap.obstacles import Obstacles
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float

Polygons = tuple[tuple[tuple[float, float], ...], ...]

# How far legs keep from a zone, longest sides of the extent. A passage of less than twice this is closed.
CLEARANCE = 1e-3

# Legs end this far before a grown zone, in clearances, and corners lie a little farther out, so that the way between
# two of them does not count as entering.
_MARGIN, _SIGHT, _CORNER = 0.05, 0.1, 0.2

# Arrays have a multiple of these lengths, so that areas of about the same detail share one compiled planner.
_EDGES, _CORNERS = 64, 32

# More corners than this and the zones are taken with less detail: the ways between all of them are a square matrix.
_MOST_CORNERS = 256


class Borders(eqx.Module):
    """The borders of no-go zones as arrays, padded: an edge of negative length, a corner that is nowhere in sight."""

    begin: Float[Array, "e 2"]  # where each edge of a border begins, domain units
    along: Float[Array, "e 2"]  # its direction, a unit vector; the free side is to its left
    length: Float[Array, " e"]  # domain units
    sharp: Bool[Array, "e 2"]  # whether the zone is on the inner side of the corner at its begin, and at its end
    corners: Float[Array, "v 2"]  # where shortest ways turn
    margin: float = eqx.field(static=True)  # legs end this far before an edge, domain units


class Zones(eqx.Module):
    """The no-go zones of a scenario as arrays, padded as their borders: nothing leads to a corner that is none."""

    borders: Borders
    legs: Float[Array, "v v"]  # length of the straight leg between two corners, inf where a zone is between them
    corner_lengths: Float[Array, "v v"]  # length of the shortest way
    places: Float[Array, "q 2"]  # the points of the evaluation grid, those at the edge of a zone moved out of it
    to_place: Float[
        Array, "v q"
    ]  # length of the shortest way from each corner to each of them, inf where there is none
    to_middle: Float[Array, "g g"]  # length of the shortest way from the grid's points (x, y) to the domain's middle


class FreeSpace:
    """What no-go zones leave free of [0, width] x [0, height], on the host: geometry, and shortest ways."""

    def __init__(self, obstacles: Obstacles, extent: tuple[float, float]) -> None:
        size = max(extent)
        self.clearance = CLEARANCE * size
        box = shapely.box(0.0, 0.0, *extent)
        # What lies far outside the domain would only cost float32 digits.
        union = shapely.intersection(obstacles.union, box.buffer(0.1 * size, join_style="mitre"))
        grown = _grown(union, self.clearance).simplify(self.clearance / 3)
        # An agent within the clearance is stopped by the zones themselves.
        borders = [_edges(each, box) for each in (grown, union)]
        self.edges = np.concatenate([edges for edges, _ in borders])  # (e, 2, 2)
        self.sharp = np.concatenate([sharp for _, sharp in borders])  # (e, 2), as in `Zones`
        self.outside = shapely.difference(box, _grown(grown, _CORNER * self.clearance))  # where ways may end
        self._core = grown.buffer(_SIGHT * self.clearance, quad_segs=2)
        self.corners = _corners(grown, self._core, box, self.clearance)  # (v, 2), where shortest ways turn
        for each in (self._core, self.outside):
            shapely.prepare(each)
        self.legs = _lengths(self.corners, self.corners, self._core)  # (v, v), inf where a zone is between two
        np.fill_diagonal(self.legs, np.inf)

    def straight(self, points: Float[np.ndarray, "q 2"], ends: Float[np.ndarray, "t 2"]) -> Float[np.ndarray, "q t"]:
        """Length of the straight leg from each point to each end, domain units; inf: a zone is between."""
        return _lengths(points, ends, self._core)

    def corner_lengths_to(self, points: Float[np.ndarray, "t 2"]) -> Float[np.ndarray, "v t"]:
        """Length of the shortest way from each corner to each point of `outside`, domain units; inf: there is none."""
        return _shortest(self.legs, _lengths(self.corners, points, self._core))

    def lengths_to(self, points: Float[np.ndarray, "q 2"], end: Float[np.ndarray, "2"]) -> Float[np.ndarray, " q"]:
        """Length of the shortest way from each point of `outside` to another one, domain units; inf: there is none."""
        straight = _lengths(points, end[None], self._core)[:, 0]
        around = _lengths(points, self.corners, self._core) + self.corner_lengths_to(end[None])[:, 0]
        return np.minimum(straight, around.min(axis=1, initial=np.inf))

    def length_between(self, point: Float[np.ndarray, "2"], end: Float[np.ndarray, "2"]) -> float:
        """Length of the shortest way between two points, which may lie at the edge of a zone; inf: there is none."""
        moved, reached = self.moved_out(np.stack([point, end]))
        steps = np.hypot(*(moved - np.stack([point, end])).T).sum()
        return float(self.lengths_to(moved[:1], moved[1])[0] + steps) if reached.all() else math.inf

    def shortest_path(
        self, point: Float[np.ndarray, "2"], end: Float[np.ndarray, "2"]
    ) -> Float[np.ndarray, "w 2"] | None:
        """The shortest way between two points, which may lie at the edge of a zone, both included.

        None where there is none; a place may be there twice in a row.
        """
        moved, reached = self.moved_out(np.stack([point, end]))
        if not reached.all():
            return None
        places, onward = [point, moved[0]], self.corner_lengths_to(moved[1:])[:, 0]
        around = _lengths(moved[:1], self.corners, self._core)[0] + onward
        while not np.isfinite(_lengths(places[-1][None], moved[1:], self._core)[0, 0]):
            if not np.isfinite(around.min(initial=np.inf)) or len(places) > len(self.corners) + 2:
                return None
            corner = int(np.argmin(around))
            places.append(self.corners[corner])
            around = self.legs[corner] + onward
        return np.array([*places, moved[1], end])

    def moved_out(self, points: Float[np.ndarray, "q 2"]) -> tuple[np.ndarray, np.ndarray]:
        """Points at the edge of a zone moved to where ways may end; True for all but those too deep in a zone."""
        if self.outside.is_empty:
            return points, np.zeros(len(points), bool)
        lines = shapely.shortest_line(self.outside, shapely.points(points))
        return shapely.get_coordinates(lines)[::2], np.asarray(shapely.length(lines) <= 3 * self.clearance)


@lru_cache(maxsize=8)
def free_space(polygons: Polygons, extent: tuple[float, float]) -> FreeSpace:
    """The free space between these no-go zones, made once. Raises InputError for polygons that are none."""
    return FreeSpace(Obstacles(polygons), extent)


def zones_of(scenario: Scenario, edges: int = 0, corners: int = 0) -> Zones | None:
    """The scenario's no-go zones; None where it has none.

    Padded to at least `edges` and `corners`. Raises InputError for polygons that are none.
    """
    if not scenario.obstacles:
        return None
    free = free_space(scenario.obstacles, scenario.extent)
    size = max(scenario.extent)
    places, reached = free.moved_out(host_grid(scenario.grid, scenario.extent))
    to_place = np.where(reached, free.corner_lengths_to(places), np.inf)
    borders = borders_of(free, scenario.extent, edges, corners)
    v, grid = len(borders.corners), (scenario.grid, scenario.grid)
    return Zones(
        borders=borders,
        legs=padded(free.legs, (v, v), np.inf),
        corner_lengths=padded(free.corner_lengths_to(free.corners), (v, v), np.inf),
        # A place that cannot be reached must not seem to be in sight either.
        places=padded(np.where(reached[:, None], places, -size), places.shape, 0.0),
        to_place=padded(to_place, (v, len(places)), np.inf),
        to_middle=padded(_to_middle(free, scenario, places, reached).reshape(grid), grid, np.inf),
    )


def borders_of(free: FreeSpace, extent: tuple[float, float], edges: int = 0, corners: int = 0) -> Borders:
    """The borders of what is free, padded to at least `edges` and `corners`."""
    size = max(extent)
    e = rounded(max(len(free.edges), edges), _EDGES)
    v = rounded(max(len(free.corners), corners), _CORNERS)
    along = free.edges[:, 1] - free.edges[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    return Borders(
        begin=padded(free.edges[:, 0], (e, 2), 0.0),
        along=padded(along / length[:, None], (e, 2), 0.0),
        sharp=padded(free.sharp, (e, 2), False),
        # Shorter than nothing by more than any tolerance: never met.
        length=padded(length, (e,), -1e3 * size),
        corners=padded(free.corners, (v, 2), -size),
        margin=_MARGIN * free.clearance,
    )


def _to_middle(free: FreeSpace, scenario: Scenario, places: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Length of the shortest way (q,) from each place to the middle of the domain, or to what is free next to it.

    Of the free parts the one of the first start, or the largest. Places without a way count as the nearest with one.
    """
    middle = 0.5 * np.asarray(scenario.extent)
    if free.outside.is_empty:
        return np.linalg.norm(places - middle, axis=1)
    parts = shapely.get_parts(free.outside)
    sizes = shapely.area(parts)
    if scenario.starts is not None:
        sizes = -shapely.distance(parts, shapely.Point(scenario.starts[0]))
    near = shapely.get_coordinates(shapely.shortest_line(parts[np.argmax(sizes)], shapely.Point(middle)))[0]
    return everywhere(np.where(reached, free.lengths_to(places, near), np.inf), places, middle)


def everywhere(
    lengths: Float[np.ndarray, " q"], places: Float[np.ndarray, "q 2"], end: Float[np.ndarray, "2"]
) -> Float[np.ndarray, " q"]:
    """The lengths of ways from places to an end, those without a way (inf) counted as the nearest one that has any."""
    found = np.isfinite(lengths)
    if not found.any():
        return np.linalg.norm(places - end, axis=1)
    offset = np.linalg.norm(places[:, None] - places[found], axis=-1)
    nearest = np.argmin(offset, axis=1)
    return np.where(found, lengths, lengths[found][nearest] + offset[np.arange(len(places)), nearest])


def _grown(zones: BaseGeometry, by: float) -> BaseGeometry:
    """The zones and all that is nearer to them than `by`; sharp corners are cut off."""
    return zones.buffer(by, join_style="mitre", mitre_limit=2.0)


def _rings(zones: BaseGeometry) -> list[np.ndarray]:
    """The borders (k, 2), closed, in the order that has the free side to the left."""
    polygons = [orient(part, -1.0) for part in shapely.get_parts(zones) if part.geom_type == "Polygon"]
    return [np.asarray(ring.coords) for part in polygons for ring in (part.exterior, *part.interiors)]


def _edges(zones: BaseGeometry, box: BaseGeometry) -> tuple[np.ndarray, np.ndarray]:
    """The edges (e, 2, 2) of the borders, but for those outside the domain, and which ends are sharp (e, 2)."""
    edges, sharp = [np.empty((0, 2, 2))], [np.empty((0, 2), bool)]
    for ring in _rings(zones):
        ring = ring[:-1]
        ring = ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]
        edges.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
        corner = _sharp(ring)
        sharp.append(np.stack([corner, np.roll(corner, -1)], axis=1))
    every, ends = np.concatenate(edges), np.concatenate(sharp)
    inside = shapely.intersects(box, np.asarray(shapely.linestrings(every))) if len(every) else np.zeros(0, bool)
    return every[inside], ends[inside]


def _sharp(ring: np.ndarray) -> np.ndarray:
    """At which vertices (k, 2) of a border the zone is on the inner side of the turn."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0


def _corners(grown: BaseGeometry, core: BaseGeometry, box: BaseGeometry, clearance: float) -> np.ndarray:
    """Where a shortest way around the grown zones may turn, (v, 2)."""
    away = _CORNER * clearance
    while True:
        found = [np.empty((0, 2))]
        for ring in _rings(_grown(grown, away)):
            found.append(ring[:-1][_sharp(ring[:-1])])
        corners = np.concatenate(found)
        corners = corners[shapely.intersects_xy(box, corners[:, 0], corners[:, 1])]
        corners = corners[~shapely.intersects_xy(core, corners[:, 0], corners[:, 1])]
        # Of corners that all but coincide one will do.
        corners = corners[np.sort(np.unique(np.round(corners / (0.1 * clearance)), axis=0, return_index=True)[1])]
        if len(corners) <= _MOST_CORNERS:
            return corners
        grown = grown.buffer(clearance).simplify(clearance / 2)
        clearance *= 2.0


def _lengths(start: np.ndarray, end: np.ndarray, core: BaseGeometry) -> np.ndarray:
    """Lengths of the legs from each start to each end, (s, t); inf where one enters the core."""
    lengths = np.full((len(start), len(end)), np.inf)
    for row, point in enumerate(start):
        legs = shapely.linestrings(np.stack([np.broadcast_to(point, end.shape), end], axis=1))
        lengths[row] = np.where(shapely.intersects(core, legs), np.inf, shapely.length(legs))
    return lengths


def _shortest(legs: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Length of the shortest ways (v, t) whose `last` legs (v, t) follow straight `legs` between corners (v, v)."""
    v, t = last.shape
    if v == 0:
        return last
    graph = np.concatenate([legs, last], axis=1)
    row, column = np.nonzero(np.isfinite(graph))
    sparse = csr_array((graph[row, column], (row, column)), shape=(v + t, v + t))
    return dijkstra(sparse, indices=np.arange(v))[:, v:]


def rounded(count: int, to: int) -> int:
    """The next multiple of `to`, so that arrays of about the same length have the same one."""
    return -(-max(count, 1) // to) * to


def padded(array: np.ndarray, shape: tuple[int, ...], value: float | int | bool) -> Array:
    """The array with `value` where it is shorter than `shape`, at JAX's precision."""
    full = np.full(shape, value, array.dtype)
    full[tuple(slice(0, n) for n in array.shape)] = array
    real = np.issubdtype(array.dtype, np.floating)
    return jax.device_put(full.astype(jnp.result_type(float)) if real else full)
