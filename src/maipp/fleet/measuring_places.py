"""Where along its way a vehicle is to measure."""

from collections.abc import Sequence

import numpy as np

from maipp.engine.polyline import followed
from maipp.typing import Float


def length_of(way: Float[np.ndarray, "v 2"]) -> float:
    """Of a polyline."""
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def distances_along(
    way: Float[np.ndarray, "v 2"], places: Sequence[Float[np.ndarray, "2"]], interval: float, since: float
) -> list[float]:
    """How far along a polyline places are that lie an `interval` apart on it, in order.

    `since` is the way from the last such place to its begin: that, and the order, tell a way out and back apart.
    """
    along, length, found = -since, length_of(way), list[float]()
    for place in places:
        along = min(followed(way, place, max(along + interval, 0.0)), length)
        found.append(along)
    return found
