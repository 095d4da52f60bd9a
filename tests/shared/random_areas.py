"""Random survey areas among no-go zones: concave outlines, islands, narrow passages."""

from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon, box

from maipp.roadmap import Obstacles
from maipp.scenario import Scenario

AGENTS, BUDGET = 2, 2.0
# What all areas have in common, so that a planner is compiled once: everything but the zones themselves.
COMMON: Any = {
    "agents": AGENTS,
    "budget": BUDGET,
    "measurement_interval": 0.2,
    "grid": 10,
    "nodes": 60,
    "neighbours": 8,
    # Everything is of interest, and a measurement tells little of what is not near it.
    "threshold": -10.0,
    "length_scale": 0.15,
    "obstacles": (((0.4, 0.4), (0.6, 0.4), (0.6, 0.6)),),
}
# Room for any of them: edges and corners of the zones, points and vertices of the lawnmower's sweep.
EDGES, CORNERS, POINTS, VERTICES = 192, 64, 128, 128


class Area(NamedTuple):
    """A random area."""

    scenario: Scenario  # with its zones and a start
    free: Polygon  # the part of it that can be reached from the start


def random_area(seed: int) -> Area:
    """A concave outline and up to five islands in the unit square.

    Every third area has a wall with a gap of one to three hundredths, every fifth a start on a border.
    """
    rng = np.random.default_rng([41, seed])
    whole = box(0, 0, 1, 1)
    while True:
        outline = _star(rng, (0.5, 0.5), int(rng.integers(8, 26)), 0.25, 1.0)
        (left, bottom), (right, top) = outline.min(axis=0), outline.max(axis=0)
        outline = (outline - (left, bottom)) / (right - left, top - bottom)
        islands = [
            _star(rng, rng.uniform(0.15, 0.85, 2), int(rng.integers(3, 9)), 0.03, rng.uniform(0.06, 0.18))
            for _ in range(rng.integers(0, 6))
        ]
        if seed % 3 == 0:  # a wall from side to side with a gap of 1 to 3 hundredths
            x, gap, width = rng.uniform(0.3, 0.7), rng.uniform(0.2, 0.8), rng.uniform(0.01, 0.03)
            islands += [np.asarray(box(x, -0.1, x + 0.04, gap).exterior.coords)]
            islands += [np.asarray(box(x, gap + width, x + 0.04, 1.1).exterior.coords)]
        # What is outside the outline, as polygons without holes that share sides.
        outside = shapely.difference(whole, Polygon(outline))
        pieces = [shapely.intersection(outside, box(a, -1, a + 0.5, 2)) for a in (0.0, 0.5)]
        parts = [p for piece in pieces for p in shapely.get_parts(piece) if p.geom_type == "Polygon" and p.area > 1e-9]
        if any(p.interiors for p in parts):
            continue
        zones = [np.asarray(p.exterior.coords)[:-1] for p in parts] + islands
        free = shapely.difference(whole, Obstacles(zones).union)
        # Passages that the clearance closes are no part of what can be reached.
        rooms = sorted(shapely.get_parts(free.buffer(-2e-3)), key=lambda p: p.area)
        if not rooms or rooms[-1].area < 0.15:
            continue
        room = rooms[-1]
        while True:
            start = rng.random(2)
            if shapely.contains_xy(room, *start):
                break
        if seed % 5 == 0:
            edge = shapely.get_coordinates(shapely.shortest_line(shapely.Point(start), free.boundary))[1]
            if Obstacles(zones).free(edge[None].astype(np.float32).astype(float))[0]:
                start = edge.astype(np.float32).astype(float)
        polygons = tuple(tuple(map(tuple, zone.tolist())) for zone in zones)
        scenario = Scenario(**COMMON | {"obstacles": polygons, "start": tuple(np.clip(start, 0, 1).tolist())})
        return Area(scenario, room)


def _star(rng: np.random.Generator, centre: Any, corners: int, least: float, most: float) -> np.ndarray:
    """A polygon (corners, 2) that is seen whole from its centre."""
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.35, 0.35, corners)) / corners
    radius = rng.uniform(least, most, corners)
    return np.asarray(centre) + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
