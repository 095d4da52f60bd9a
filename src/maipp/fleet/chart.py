"""The place of a survey as the page draws it: in lengths from the lower left corner, which no projection bends."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from maipp.live.team import TeamSurvey
from maipp.live.units import Units
from maipp.surveys.standardise import EVERYTHING
from maipp.typing import Float

Pair = list[float]


class Chart:
    """From the caller's coordinates, and from domain units, to the page's: lengths to the east and north."""

    def __init__(self, units: Units) -> None:
        self._units, self._scale = units, units.length_out(1.0)

    def place(self, position: Any) -> Pair | None:
        """Of the caller's coordinates; None for what is no position, or far outside of the area."""
        try:
            x, y = (float(number) for number in position)
            return self.of_domain([self._units.position("position", (x, y))])[0]
        except (TypeError, ValueError, OverflowError):  # InputError is a ValueError
            return None

    def places(self, positions: Sequence[Sequence[float]]) -> list[Pair]:
        """Of several, without those that are none."""
        return [place for place in map(self.place, positions) if place is not None]

    def of_domain(self, points: Any) -> list[Pair]:
        """Of domain positions (n, 2)."""
        return np.round(np.asarray(points, np.float64).reshape(-1, 2) * self._scale, 5).tolist()

    def to_domain(self, place: Pair) -> Float[np.ndarray, "2"]:
        """The domain position of a place."""
        return np.array(place) / self._scale

    def covariance(self, told: Sequence[float]) -> Pair:
        """xx, xy, yy of a message, in squared lengths."""
        return [float(number) for number in told]


def place_part(survey: TeamSurvey, chart: Chart) -> dict[str, Any]:
    """What does not change, of a survey that nothing was changed of yet: units, area, no-go zones, starts and ends."""
    setup, world = survey.setup, survey.world
    units, site, (width, height) = setup.units, setup.site, world.scenario.extent
    frame, home = units.frame, world.mission.home
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    no_go = [chart.places(ring) for ring in site.no_go]
    if site.area is None:
        no_go = [chart.of_domain(ring) for ring in world.scenario.obstacles]
    mean, std = units.values_out(np.zeros(1))[0], units.std_out(np.array([world.scenario.signal_variance**0.5]))[0]
    return {
        "title": site.title,
        "planner": setup.planner,
        "units": units.names,
        "quantity": "value" if frame is None else frame.quantity,
        "size": chart.of_domain(corners[3:])[0],
        "corners": units.points_out(corners),  # south-west, south-east, north-west, north-east, caller's coordinates
        "area": None if site.area is None else chart.places(site.area),
        "no_go": no_go,
        "starts": chart.of_domain(world.mission.start),
        "ends": [] if home is None else chart.of_domain(np.asarray(home.ends.places)[np.asarray(home.ends.bound)]),
        "below": frame is not None and frame.inverted,  # low values are of interest
        "everything": world.scenario.threshold <= EVERYTHING,
        "prior": {"mean": mean, "std": std},
        "epoch": units.epoch,
    }
