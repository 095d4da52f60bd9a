"""Paired tests: two planners on the same worlds."""

import math
from typing import Any, NamedTuple

import numpy as np

from maipp.typing import Float


class Paired(NamedTuple):
    """How one planner differs from another on the same instances."""

    mean: float  # of the difference of the means over trials
    se: float | None  # its standard error, over instances; None for one instance
    p: float | None  # of Wilcoxon's signed-rank test, two-sided; None for one instance


def paired(values: Float[np.ndarray, "instances trials"], reference: Float[np.ndarray, "instances others"]) -> Paired:
    """`values` minus `reference`, each the mean over its trials, instance by instance.

    An instance is the same world for both; the trials differ in roadmaps and random draws, and may differ in number.
    """
    from scipy.stats import wilcoxon

    difference = values.mean(axis=1) - reference.mean(axis=1)
    count = len(difference)
    if count < 2:
        return Paired(float(difference.mean()), None, None)
    se = float(difference.std(ddof=1) / math.sqrt(count))
    if not difference.any():  # nothing to rank
        return Paired(0.0, se, 1.0)
    test: Any = wilcoxon(difference)
    return Paired(float(difference.mean()), se, float(test.pvalue))
