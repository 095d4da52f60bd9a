"""Coordinates as files write them: rounded to what a position is worth."""

import numpy as np
import shapely
from jaxtyping import Float

from maipp.route_files.route_plan import Ring

DEGREE_DECIMALS = 7  # 11 mm, and what MAVLink transmits
METRE_DECIMALS = 3


def rounded(points: Float[np.ndarray, "n 2"], *, geographic: bool) -> list[list[float]]:
    """The positions as lists of numbers that print with at most 7 decimals (degrees) or 3 (metres)."""
    # Adding 0 turns -0.0 into 0.0.
    return (np.round(points, DEGREE_DECIMALS if geographic else METRE_DECIMALS) + 0.0).tolist()


def seconds(times: Float[np.ndarray, " k"]) -> list[float]:
    """The times to a hundredth of a second."""
    return (np.round(times, 2) + 0.0).tolist()


def counterclockwise(ring: Ring) -> Ring:
    """The ring, so turned that what it encloses lies to the left."""
    return ring if shapely.is_ccw(shapely.linearrings(ring)) else ring[::-1]
