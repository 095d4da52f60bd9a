"""How a measure spreads over rehearsals."""

import math
from typing import NamedTuple

import numpy as np

from maipp.typing import Float


class Spread(NamedTuple):
    """One measure over all fields; NaN values (nothing of high interest) left out."""

    mean: float
    std: float
    low: float  # 10th percentile
    high: float  # 90th


def spread(values: Float[np.ndarray, " f"]) -> Spread:
    """Mean, standard deviation and the range of the middle 80 %; NaN throughout where no value counts."""
    values = values[np.isfinite(values)]
    if not len(values):
        return Spread(*[math.nan] * 4)
    std = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    low, high = np.percentile(values, [10, 90])
    return Spread(float(values.mean()), std, float(low), float(high))
