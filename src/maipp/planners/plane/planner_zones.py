"""The no-go zones that legs in the plane keep out of."""

import numpy as np

from maipp.problem import ScenarioLike
from maipp.roadmap import Obstacles, check_starts
from maipp.roadmap.zones import Zones, zones_of
from maipp.scenario import Scenario


def planner_zones(scenario: ScenarioLike) -> Zones | None:
    """The zones of a scenario as arrays; None where it has none, and for a `Problem`, whose planner holds them already.

    Areas of the same size and about the same detail can share one compiled planner: what is static of the scenario must
    agree, then a planner's zones may be another area's. Raises `InputError` for a start inside a zone.
    """
    if not isinstance(scenario, Scenario) or not scenario.has_zones:
        return None
    if scenario.starts is not None:
        check_starts(np.asarray(scenario.starts), np.asarray(scenario.extent), Obstacles(scenario.obstacles))
    return zones_of(scenario)
