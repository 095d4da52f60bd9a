"""The world that a survey is in after what was changed of it: a function of the mission, the seed and the changes."""

import dataclasses
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.engine import Mission
from maipp.errors import InputError
from maipp.live.changes import Changes, Level, Ring
from maipp.live.world import Setup, World, draw_world, room_in
from maipp.planners import make_planner
from maipp.problem import Problem, shape_of
from maipp.roadmap import Home, free_space, home_of
from maipp.scenario import Scenario
from maipp.surveys.complement import without_holes
from maipp.surveys.standardise import interest_beta
from maipp.typing import Float

Pair = tuple[float, float]

# Zones are drawn no farther than this beyond the domain, longest sides: nothing there matters.
_BEYOND = 0.1


class Worlds:
    """The world of the mission, and those that changes make of it; each is drawn when it is first asked for."""

    def __init__(self, base: World, setup: Setup) -> None:
        """`base` is the world that nothing was changed of yet."""
        self.base, self.setup = base, setup
        self._starts = [(float(x), float(y)) for x, y in np.asarray(base.mission.start, np.float64)]
        # What a person undoes is often wanted again, and what is refused never was.
        self._drawn, self._of = lru_cache(4)(self._draw), lru_cache(4)(self._make)
        self.nothing = lru_cache(4)(self._nothing)

    def of(self, changes: Changes) -> World:
        """The world after these changes. Raises `InputError` where they leave no room for the survey."""
        return self._of(changes)

    def room(self, changes: Changes) -> int:
        """Measurements of each robot that there is room for at first."""
        budgets = [*self.base.scenario.budgets, *(joiner.budget for joiner in changes.joined)]
        return room_in(self.base.scenario.replace(budget=max(budgets)))

    def starts(self, changes: Changes) -> list[Pair]:
        """Where each robot began, domain units."""
        return [*self._starts, *(joiner.position for joiner in changes.joined)]

    def grown(self, ring: Ring) -> list[Ring]:
        """What robots keep out of for a zone's sake: it and the clearance around it, as polygons without holes."""
        clearance, extent = self.setup.clearance, self.base.scenario.extent
        region = Polygon(ring)
        if clearance > 0:
            # Sharp corners are cut off, no nearer than the clearance.
            region = region.buffer(clearance, join_style="mitre", mitre_limit=2.0)
        box = shapely.box(0.0, 0.0, *extent).buffer(_BEYOND * max(extent), join_style="mitre")
        parts = without_holes(shapely.intersection(region, box))
        return [tuple(map(tuple, shapely.get_coordinates(part)[:-1].tolist())) for part in parts]

    def obstacles(self, changes: Changes) -> tuple[Ring, ...]:
        """All no-go zones, domain units."""
        added = (part for ring in changes.rings.values() for part in self.grown(ring))
        return (*self.base.scenario.obstacles, *added)

    def ends(self, changes: Changes) -> list[tuple[Pair, ...]]:
        """Where each robot may end: at any of these places, or anywhere if there are none, domain units."""
        scenario = self.base.scenario
        own = scenario.ends_from(self._starts) if scenario.homes else ((),) * scenario.agents
        return [*own, *(joiner.ends for joiner in changes.joined)]

    def scenario(self, changes: Changes) -> Scenario:
        """The scenario after these changes. Places to end at that lie in a zone are none."""
        base, joined = self.base.scenario, changes.joined
        obstacles = self.obstacles(changes)
        ends = [open_places(obstacles, base.extent, places) for places in self.ends(changes)]
        values = {
            "agents": base.agents + len(joined),
            "budget": [*base.budgets, *(joiner.budget for joiner in joined)],
            "speed": [*base.speeds, *(joiner.speed for joiner in joined)],
            "reserve": [*base.reserves, *(0.0 for _ in joined)],
            "start": changes.anchors or self.starts(changes),
            "end": ends if any(ends) else None,
            "obstacles": obstacles,
        }
        return base.replace(**values)

    def _make(self, changes: Changes) -> World:
        geometry = changes.geometry
        world = self._drawn(geometry) if geometry.zones or geometry.joined else self.base
        return world if changes.threshold is None else self._from_threshold(world, changes.threshold)

    def _draw(self, changes: Changes) -> World:
        """The world with these zones and robots."""
        setup, old, scenario = self.setup, self.base.mission, self.scenario(changes)
        planner = make_planner(setup.planner, scenario, setup.options)
        if scenario.obstacles and not planner.avoids_obstacles:
            raise InputError(f"planner {setup.planner} would cross the no-go zones; no zone can be added to its survey")
        # Budgets from the start on say nothing of who is under way: the ends are found here.
        drawn = draw_world(planner, scenario.replace(end=None), setup.seed)
        positions = [joiner.position for joiner in changes.joined]
        mission = dataclasses.replace(
            drawn.mission,
            shape=shape_of(scenario),
            start=jnp.concatenate([old.start, jnp.asarray(positions, old.start.dtype).reshape(-1, 2)]),
            home=self._home(scenario),
            prior_x=old.prior_x,
            prior_y=old.prior_y,
            prior_noise=old.prior_noise,
        )
        return World(scenario, planner, mission, self.base.key)

    def _home(self, scenario: Scenario) -> Home | None:
        if not scenario.homes:
            return None
        ends = scenario.ends_from(scenario.starts)
        return home_of(ends, scenario.obstacles, scenario.extent, scenario.grid)

    def _from_threshold(self, world: World, level: Level) -> World:
        """The world with another threshold, and the confidence that goes with it."""
        own = not self.setup.beta_follows
        beta = world.scenario.beta if own else interest_beta(level.value)
        scenario = world.scenario.replace(threshold=level.value, beta=beta)
        numbers = {name: jnp.asarray(getattr(scenario, name), jnp.result_type(float)) for name in ("threshold", "beta")}
        mission: Mission = world.mission
        mission = dataclasses.replace(mission, params=dataclasses.replace(mission.params, **numbers))
        return dataclasses.replace(world, scenario=scenario, mission=mission)

    def _nothing(self, agents: int) -> tuple[Any, Any]:
        """The planner's empty message and memory in a team of this size, on the host; draws nothing."""
        problem: Problem = self.base.mission.problem
        planner = self.base.planner
        if agents != problem.shape.agents:
            planner = planner.on(Problem(dataclasses.replace(problem.shape, agents=agents), problem.params))
        return jax.device_get(planner.empty_message()), jax.device_get(planner.initial_memory())


def open_places(obstacles: tuple[Ring, ...], extent: Pair, places: tuple[Pair, ...]) -> tuple[Pair, ...]:
    """Those of the places that no zone covers, domain units."""
    if not (obstacles and places):
        return places
    _, reached = free_space(obstacles, extent).moved_out(np.array(places))
    return tuple(place for place, free in zip(places, reached, strict=True) if free)


def own_parts(
    obstacles: tuple[Ring, ...], extent: Pair, starts: Float[np.ndarray, "m 2"], places: Float[np.ndarray, "m 2"]
) -> tuple[Pair, ...]:
    """Where the roadmap of each robot is to begin: where it did, or where it is now if no way joins the two.

    What lies in a zone is moved out of it. Domain units. Raises `InputError` where the zones leave nothing free.
    """
    if not obstacles:
        return tuple((float(x), float(y)) for x, y in np.clip(starts, 0.0, extent))
    free = free_space(obstacles, extent)
    parts = shapely.get_parts(free.outside)
    if free.outside.is_empty:
        raise InputError("leaves nothing of the survey's area; give a smaller zone")

    def part_of(point: Float[np.ndarray, "2"]) -> int:
        return int(np.argmin(shapely.distance(parts, shapely.Point(point))))

    anchors = []
    for start, place in zip(starts, places, strict=True):
        begin = start if part_of(start) == part_of(place) else place
        if shapely.distance(free.outside, shapely.Point(begin)) > 0:
            begin = shapely.get_coordinates(shapely.shortest_line(free.outside, shapely.Point(begin)))[0]
        anchors.append((float(begin[0]), float(begin[1])))
    return tuple(anchors)
