"""What every planner in the plane shares: the no-go zones that its legs keep out of."""

import equinox as eqx
import numpy as np

from maipp.engine.decision import Planner
from maipp.roadmap import Obstacles, check_starts
from maipp.roadmap.zones import Zones, zones_of
from maipp.scenario import Scenario


class PlanePlanner(Planner):
    """Base of the planners whose legs may go anywhere in the domain but through its no-go zones.

    The zones are arrays, so areas of the same size and about the same detail can share one compiled planner: what is
    static of the scenario must agree, then `zones` may be another area's.
    """

    zones: Zones | None = eqx.field(default=None, kw_only=True)  # None: those of the scenario, if it has any

    avoids_obstacles = True

    def __post_init__(self) -> None:
        if self.zones is None and isinstance(self.scenario, Scenario) and self.scenario.has_zones:
            if self.scenario.starts is not None:
                check_starts(
                    np.asarray(self.scenario.starts),
                    np.asarray(self.scenario.extent),
                    Obstacles(self.scenario.obstacles),
                )
            self.zones = zones_of(self.scenario)
