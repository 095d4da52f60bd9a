"""Robots that are not where a planner thought: led out of no-go zones, and around them."""

from functools import lru_cache

import numpy as np
import shapely

from maipp.engine.polyline import without_repeats
from maipp.roadmap import Obstacles
from maipp.roadmap.zones import free_space
from maipp.scenario import Scenario
from maipp.typing import Float


@lru_cache(maxsize=4)
def _zones(scenario: Scenario) -> Obstacles | None:
    return Obstacles(scenario.obstacles) if scenario.obstacles else None


def path_out(scenario: Scenario, position: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
    """The nearest place where a planner may begin: the position itself, but in a zone and outside of the domain."""
    inside = np.clip(position, 0.0, scenario.extent)
    zones = _zones(scenario)
    if zones is None or (zones.free(position[None])[0] and (inside == position).all()):
        return inside
    free = free_space(scenario.obstacles, scenario.extent).outside
    if free.is_empty:
        return position
    return shapely.get_coordinates(shapely.shortest_line(free, shapely.Point(position)))[0]


def keep_out(scenario: Scenario, leg: Float[np.ndarray, "v 2"]) -> Float[np.ndarray, "w 2"] | None:
    """The leg, its parts that cross a no-go zone led around it by the shortest way; None: there is none."""
    zones = _zones(scenario)
    if zones is None or not (crosses := zones.crosses(leg[:-1], leg[1:])).any():
        return leg
    free, places = free_space(scenario.obstacles, scenario.extent), [leg[:1]]
    for begin, end, around in zip(leg[:-1], leg[1:], crosses, strict=True):
        way = free.shortest_path(begin, end) if around else np.stack([begin, end])
        if way is None:
            return None
        places.append(way[1:])
    return without_repeats(np.concatenate(places))
