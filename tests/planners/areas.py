"""Random survey areas with islands, and surveys of them that share one compiled planner."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import shapely
from shapely.geometry import Polygon, box

from maipp.planners import make_planner
from maipp.planners.sweep import clipped_sweep
from maipp.roadmap import Obstacles, laplacian_encoding, sample_roadmaps
from maipp.roadmap.zones import zones_of
from maipp.scenario import Scenario
from maipp.simulator import draw_missions, run_missions

AGENTS, BUDGET = 2, 2.0
# What all areas have in common, so that a planner is compiled once: everything but the zones themselves.
COMMON: Any = {
    "agents": AGENTS,
    "budget": BUDGET,
    "grid": 10,
    "nodes": 60,
    "neighbours": 8,
    # Everything is of interest, and a measurement tells little of what is not near it.
    "threshold": -10.0,
    "length_scale": 0.15,
    "obstacles": (((0.4, 0.4), (0.6, 0.4), (0.6, 0.6)),),
}
EDGES, CORNERS, POINTS, VERTICES = 192, 64, 128, 128

# An agent whose measurements are this many times in a row around one place stays there.
_WINDOW = 5


class Area(NamedTuple):
    """A random area."""

    scenario: Scenario  # with its zones and a start
    free: Polygon  # the part of it that can be reached from the start


def random_area(seed: int) -> Area:
    """A concave outline, up to five islands, on every third one a wall with a narrow gap; on every fifth the start is
    on a border."""
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
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.35, 0.35, corners)) / corners
    radius = rng.uniform(least, most, corners)
    return np.asarray(centre) + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


class Surveyed(NamedTuple):
    """A survey of an area, on the host."""

    odometer: np.ndarray  # (m,)
    routes: list[np.ndarray]  # (k, 2) each
    crossed: int  # legs that enter a zone
    unmeasured: float  # part of the reachable grid points that are far from every measurement
    stuck: int  # times that an agent stayed around one place while such points remained


class Surveyor:
    """Surveys areas with one planner, compiled for the first of them."""

    def __init__(self, name: str, options: dict[str, Any]) -> None:
        self.common = Scenario(**COMMON)
        self.planner = make_planner(name, self.common, options)
        self.world = draw_missions(self.common, seed=3, instances=1, roadmaps=False)

    def survey(self, area: Area, seed: int) -> Surveyed:
        """One survey of the area."""
        scenario, planner, obstacles = area.scenario, self.planner, Obstacles(area.scenario.obstacles)
        if hasattr(planner, "zones"):
            changes: dict[str, Any] = {"zones": zones_of(scenario, EDGES, CORNERS)}
            if hasattr(planner, "sweep"):
                changes["sweep"] = clipped_sweep(scenario, *planner.tuned(), CORNERS, POINTS, VERTICES)
            planner = dataclasses.replace(planner, **changes)
        assert scenario.starts is not None
        starts = np.asarray(scenario.starts, np.float32)
        grid = np.asarray(self.world.grid[0], float)
        inside = obstacles.free(grid)
        roadmap = None
        if planner.uses_roadmap:
            made = sample_roadmaps(
                np.random.default_rng(seed),
                starts.astype(float),
                nodes=scenario.nodes,
                neighbours=scenario.neighbours,
                obstacles=scenario.obstacles,
            )
            if planner.encoding_dimensions:
                made = dataclasses.replace(made, encoding=laplacian_encoding(made, planner.encoding_dimensions))
            roadmap = jax.tree.map(lambda a: jnp.asarray(a, None if a.dtype.kind in "ib" else jnp.float32)[None], made)
        mission = eqx.tree_at(
            lambda m: (m.start, m.inside, m.roadmap),
            self.world,
            (jnp.asarray(starts)[None], jnp.asarray(inside)[None], roadmap),
            is_leaf=lambda x: x is None,
        )
        states = run_missions(self.common, planner, mission, jax.random.key(seed))
        states = jax.tree.map(np.asarray, states)
        assert not states.active.any()
        routes = [states.route[0, i, : states.route_length[0, i]].astype(float) for i in range(AGENTS)]
        crossed = 0
        for route in routes:
            moved = route[np.concatenate([[True], (np.diff(route, axis=0) != 0).any(axis=1)])]
            if len(moved) > 1:
                crossed += int(obstacles.crosses(moved[:-1], moved[1:]).sum())
        reachable = shapely.contains_xy(area.free, grid[:, 0], grid[:, 1])
        places, times = states.measurement_x[0], states.measurement_time[0]
        stuck = 0
        for agent in range(AGENTS):
            for s in range(places.shape[1] - _WINDOW + 1):
                window = places[agent, s : s + _WINDOW]
                if not np.isfinite(times[agent, s + _WINDOW - 1]):
                    continue
                confined = np.linalg.norm(window - window.mean(axis=0), axis=1).max() < 0.1
                end = times[agent, s + _WINDOW - 1]
                stuck += bool(confined and _far(grid[reachable], places[times <= end]) > 0.05)
        return Surveyed(states.odometer[0], routes, crossed, _far(grid[reachable], places[np.isfinite(times)]), stuck)


def _far(points: np.ndarray, measured: np.ndarray) -> float:
    """Part of the points that are far from every measurement."""
    return float((np.linalg.norm(points[:, None] - measured, axis=-1).min(axis=1) > 0.25).mean())
