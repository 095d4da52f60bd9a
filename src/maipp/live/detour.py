"""Legs of robots that are not where a planner thought: kept out of the no-go zones all the same."""

from functools import lru_cache

import numpy as np
import shapely
from shapely.ops import nearest_points

from maipp.roadmap import Obstacles
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Float


@lru_cache(maxsize=4)
def _zones(scenario: Scenario) -> Obstacles | None:
    return Obstacles(scenario.obstacles) if scenario.obstacles else None


def keep_out(
    scenario: Scenario, leg: Float[np.ndarray, "v 2"], nodes: Float[np.ndarray, "n 2"] | None
) -> Float[np.ndarray, "w 2"] | None:
    """The leg, led around no-go zones by way of one of the roadmap's `nodes` where it crosses any; None: no way found.

    A robot that has drifted into a zone first leaves it by the shortest way.
    """
    zones = _zones(scenario)
    if zones is None or not zones.crosses(leg[:-1], leg[1:]).any():
        return leg
    out = [] if zones.free(leg[:1])[0] else [leg[0]]
    start = _exit(zones, leg[0]) if out else leg[0]
    direct = np.concatenate([start[None], leg[1:]])
    if not zones.crosses(direct[:-1], direct[1:]).any():
        return np.array([*out, *direct])
    if nodes is None or zones.crosses(leg[1:-1], leg[2:]).any():
        return None
    first = zones.crosses(np.broadcast_to(start, nodes.shape), nodes)
    second = zones.crosses(nodes, np.broadcast_to(leg[1], nodes.shape))
    way = np.hypot(*(nodes - start).T) + np.hypot(*(leg[1] - nodes).T)
    way[first | second] = np.inf
    best = int(np.argmin(way))
    return np.array([*out, start, nodes[best], *leg[1:]]) if np.isfinite(way[best]) else None


def _exit(zones: Obstacles, position: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
    """The nearest place outside of the zones, by a hair more than on their border."""
    border = nearest_points(zones.union.boundary, shapely.Point(position))[0]
    step = np.array([border.x, border.y]) - position
    return position + step * (1.0 + 2 * DISTANCE_TOLERANCE / max(float(np.hypot(*step)), DISTANCE_TOLERANCE))
