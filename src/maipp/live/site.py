"""Where a live survey is, for people: its name, its area, and the coordinates that its maps are in."""

from dataclasses import dataclass

import numpy as np

from maipp.geo import PLANE, Crs
from maipp.surveys.standardise import PreparedSurvey

Ring = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Site:
    """What a mission file says of the place besides the problem itself; by default, of a scenario, nothing."""

    title: str = "Live survey"
    crs: Crs = PLANE  # of the positions in the mission file
    area: Ring | None = None  # border of the area, the caller's coordinates; None: the domain without its obstacles
    no_go: tuple[Ring, ...] = ()  # borders of what must not be entered, likewise
    threshold: bool = True  # whether one was given; without one all of the area is of interest

    @classmethod
    def of(cls, prepared: PreparedSurvey) -> "Site":
        """That of a mission file."""
        survey = prepared.survey
        zones = tuple(map(_ring, prepared.no_go))
        return cls(survey.name, prepared.crs, _ring(prepared.area), zones, survey.threshold is not None)


def _ring(points: np.ndarray) -> Ring:
    return tuple((float(x), float(y)) for x, y in points)
