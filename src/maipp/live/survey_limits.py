"""Where robots may go, begin and end after what was changed of a survey: geometry alone, nothing is drawn."""

import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.live.changes import Changes, Pair, Ring
from maipp.live.world import first_room
from maipp.roadmap import free_space
from maipp.scenario import Scenario
from maipp.surveys.complement import without_holes
from maipp.typing import Float

# Zones are drawn no farther than this beyond the domain, longest sides: nothing there matters.
_BEYOND = 0.1


class SurveyLimits:
    """What the mission and changes of it say of places, budgets and speeds."""

    def __init__(self, mission: Scenario, starts: Float[np.ndarray, "m 2"], clearance: float) -> None:
        """The mission's scenario, where its robots begin, and how clear of added zones they keep, domain units."""
        self.mission, self.clearance = mission, clearance
        self._starts = [(float(x), float(y)) for x, y in starts]

    def room(self, changes: Changes) -> int:
        """Measurements of each robot that there is room for at first."""
        budgets = [*self.mission.budgets, *(joiner.budget for joiner in changes.joined)]
        return first_room(self.mission.replace(budget=max(budgets)))

    def starts(self, changes: Changes) -> list[Pair]:
        """Where each robot began, domain units."""
        return [*self._starts, *(joiner.position for joiner in changes.joined)]

    def grown(self, ring: Ring) -> list[Ring]:
        """What robots keep out of for a zone's sake: it and the clearance around it, as polygons without holes."""
        clearance, extent = self.clearance, self.mission.extent
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
        return (*self.mission.obstacles, *added)

    def ends(self, changes: Changes) -> list[tuple[Pair, ...]]:
        """Where each robot may end: at any of these places, or anywhere if there are none, domain units."""
        scenario = self.mission
        own = scenario.ends_from(self._starts) if scenario.homes else ((),) * scenario.agents
        return [*own, *(joiner.ends for joiner in changes.joined)]

    def scenario(self, changes: Changes) -> Scenario:
        """The scenario after these changes. Places to end at that lie in a zone are none."""
        base, joined = self.mission, changes.joined
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
