"""Coordinates as files write them: rounded to what a position is worth."""

import numpy as np
from jaxtyping import Float

from maipp.missions.route_plan import Ring

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
    x, y = (ring - ring[0]).T  # near 0, so that the products keep their digits
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    return ring if area > 0 else ring[::-1]
