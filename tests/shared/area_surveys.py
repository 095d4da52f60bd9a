"""Surveys of random areas among no-go zones with one planner, compiled once for all of them."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import shapely

from maipp.engine import Mission, Planner, State, draw_missions, run_missions
from maipp.engine.score import moments_of, score_belief, taken_by
from maipp.planners import make_planner
from maipp.planners.lawnmower import Lawnmower
from maipp.planners.plane.sweep import clipped_sweep
from maipp.roadmap import (
    FreeSpace,
    Home,
    Obstacles,
    Roadmap,
    free_space,
    home_of,
    laplacian_encoding,
    sample_roadmaps,
    zones_of,
)
from maipp.roadmap.zones import borders_of, padded
from maipp.scenario import Scenario
from maipp.typing import Float
from tests.shared.random_areas import AGENTS, BUDGET, COMMON, CORNERS, EDGES, POINTS, VERTICES, Area

# An agent whose measurements are this many times in a row within this distance of their middle stays in one place.
_WINDOW, _PLACE = 5, 0.1

# What float32 may round positions by, domain units.
_ROUNDING = 1e-6

# A point farther than this from every measurement is unmeasured, domain units; a part of this size is worth going to.
_UNMEASURED, _WORTH_GOING = 0.25, 0.05


def zones_in(planner: Planner) -> list[Any]:
    """Where a planner and its parts hold no-go zones; those that move on roadmaps hold none."""
    holders: list[Any] = [planner, *planner.parts]
    return [holder.zones for holder in holders if hasattr(holder, "zones")]


class Surveyed(NamedTuple):
    """A survey of an area, on the host."""

    odometer: Float[np.ndarray, " m"]  # distance travelled by each agent, domain units
    routes: list[np.ndarray]  # vertices (k, 2) of each agent's route
    crossed: int  # legs that enter a zone
    unmeasured: float  # part of the reachable grid points that are far from every measurement
    stuck: int  # times that an agent stayed around one place while it could have reached such points
    trace: float  # Tr(P) of all that was measured


class Surveyor:
    """Surveys areas with one planner, compiled for the first of them; with `homes` robots end where they are told."""

    def __init__(self, name: str, options: dict[str, Any], homes: bool = False) -> None:
        self.common = Scenario(**COMMON, end=(0.1, 0.1) if homes else None)
        self.planner = make_planner(name, self.common, options)
        self.world = draw_missions(self.common, seed=3, instances=1, roadmaps=False)

    def survey(self, area: Area, seed: int, end: tuple[float, float] | None = None, reserve: float = 0.0) -> Surveyed:
        """One survey of the area; `seed` is that of the roadmaps and of the planner.

        All robots end at `end`, with `reserve` of their budget left, domain units.
        """
        scenario, planner, obstacles = area.scenario, self.planner, Obstacles(area.scenario.obstacles)
        # What is static of a planner stays that of the common scenario; the zones are arrays.
        if isinstance(planner, Lawnmower):
            rows, margin = planner.tuned()
            sweep = clipped_sweep(scenario, int(rows), float(margin), CORNERS, POINTS, VERTICES)
            planner = dataclasses.replace(planner, sweep=sweep)
        if count := len(zones_in(planner)):
            zones = [zones_of(scenario, EDGES, CORNERS)] * count
            planner = eqx.tree_at(zones_in, planner, zones, is_leaf=lambda leaf: leaf is None)
        starts = np.asarray(scenario.starts, np.float32)
        grid = np.asarray(self.world.grid[0], float)
        inside = obstacles.free(grid)
        roadmap = self._roadmap(area, starts, seed) if planner.uses_roadmap else None
        mission: Mission = eqx.tree_at(
            lambda mission: (mission.start, mission.inside, mission.roadmap, mission.home, mission.params.reserves),
            self.world,
            (
                jnp.asarray(starts)[None],
                jnp.asarray(inside)[None],
                roadmap,
                None if end is None else _home(scenario, end),
                jnp.full((1, AGENTS), reserve),
            ),
            is_leaf=lambda leaf: leaf is None,
        )
        finished = run_missions(planner, mission, jax.random.key(seed))
        trace = float(_trace(mission, finished)[0])
        states = jax.tree.map(np.asarray, finished)
        routes = [states.route[0, i, : states.route_length[0, i]].astype(float) for i in range(AGENTS)]
        points = grid[shapely.contains_xy(area.free, grid[:, 0], grid[:, 1])]
        free = free_space(scenario.obstacles, scenario.extent)
        places, times = states.measurement_x[0], states.measurement_time[0]
        return Surveyed(
            odometer=states.odometer[0],
            routes=routes,
            crossed=sum(_crossed(obstacles, route) for route in routes),
            unmeasured=_far(points, places[np.isfinite(times)]),
            stuck=sum(_stays(free, points, places, times, agent) for agent in range(AGENTS)),
            trace=trace,
        )

    def _roadmap(self, area: Area, starts: Float[np.ndarray, "m 2"], seed: int) -> Roadmap:
        """The agents' roadmaps of an area, (1, m, ...)."""
        scenario, encodings = area.scenario, self.planner.encoding_dimensions
        made = sample_roadmaps(
            np.random.default_rng(seed),
            starts,
            nodes=scenario.nodes,
            neighbours=scenario.neighbours,
            obstacles=scenario.obstacles,
        )
        if encodings:
            made = dataclasses.replace(made, encoding=laplacian_encoding(made, encodings))
        real = jnp.result_type(float)
        return jax.tree.map(lambda a: jnp.asarray(a, real if a.dtype.kind == "f" else None)[None], made)


@eqx.filter_jit
def _trace(missions: Mission, states: State) -> Float[jax.Array, " b"]:
    return jax.vmap(
        lambda mission, state: score_belief(mission, moments_of(mission, state), taken_by(state, jnp.inf)).trace
    )(missions, states)


def _home(scenario: Scenario, end: tuple[float, float]) -> Home:
    """The way to a place, (1, ...), with room for any area's."""
    home = home_of([[end]] * AGENTS, scenario.obstacles, scenario.extent, scenario.grid)
    borders = borders_of(free_space(scenario.obstacles, scenario.extent), scenario.extent, EDGES, CORNERS)
    shape = AGENTS, len(borders.corners)
    ends = home.ends._replace(
        onward=padded(np.asarray(home.ends.onward), shape, np.inf),
        turn=padded(np.asarray(home.ends.turn), shape, -1),
        door=padded(np.asarray(home.ends.door), shape, 0),
    )
    return jax.tree.map(lambda array: array[None], Home(ends, borders))


def _crossed(obstacles: Obstacles, route: Float[np.ndarray, "k 2"]) -> int:
    """Legs of a route that enter a zone; one that sets out from a border may do so by what float32 rounds."""
    moves = (np.diff(route, axis=0) != 0).any(axis=1)
    start, end = route[:-1][moves], route[1:][moves]
    crossing = np.flatnonzero(obstacles.crosses(start, end))
    if shapely.distance(obstacles.union, shapely.Point(route[0])) < _ROUNDING:
        legs = shapely.linestrings(np.stack([start, end], axis=1)[crossing])
        crossing = crossing[shapely.length(shapely.intersection(obstacles.union, legs)) > _ROUNDING]
    return len(crossing)


def _stays(
    free: FreeSpace,
    points: Float[np.ndarray, "q 2"],
    places: Float[np.ndarray, "m s 2"],
    times: Float[np.ndarray, "m s"],
    agent: int,
) -> int:
    """Times that an agent went on measuring around one place though its budget reached a part that was unmeasured."""
    count = 0
    for first in range(places.shape[1] - _WINDOW + 1):
        last = first + _WINDOW - 1
        window, now = places[agent, first : last + 1], times[agent, last]
        if np.isfinite(now) and np.linalg.norm(window - window.mean(axis=0), axis=1).max() < _PLACE:
            remaining = BUDGET - (last + 1) * COMMON["measurement_interval"]
            here = free.moved_out(window[-1:].astype(float))[0][0]
            reached = free.lengths_to(free.moved_out(points)[0], here) <= remaining
            unmeasured = _distance(points, places[times <= now]) > _UNMEASURED
            count += bool((unmeasured & reached).mean() > _WORTH_GOING)
    return count


def _far(points: Float[np.ndarray, "q 2"], measured: Float[np.ndarray, "n 2"]) -> float:
    """Part of the points that are far from every measurement."""
    return float((_distance(points, measured) > _UNMEASURED).mean())


def _distance(points: Float[np.ndarray, "q 2"], measured: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " q"]:
    """From each point to the nearest measurement, domain units."""
    return np.linalg.norm(points[:, None] - measured, axis=-1).min(axis=1)
