"""Paired tests: two planners on the same worlds."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from maipp.typing import Float


class Paired(NamedTuple):
    """How one planner differs from another on the same instances."""

    mean: float  # of the difference of the means over trials
    se: float | None  # its standard error, over instances; None for one instance
    interval: tuple[float, float] | None  # that holds it with 95 %, by Student's t; None for one instance
    p: float | None  # of Wilcoxon's signed-rank test, two-sided; None for one instance


def paired(values: Float[np.ndarray, "instances trials"], reference: Float[np.ndarray, "instances others"]) -> Paired:
    """`values` minus `reference`, each the mean over its trials, instance by instance.

    An instance is the same world for both; the trials differ in roadmaps and random draws, and may differ in number.
    """
    from scipy.stats import t, wilcoxon

    difference = values.mean(axis=1) - reference.mean(axis=1)
    count = len(difference)
    if count < 2:
        return Paired(float(difference.mean()), None, None, None)
    mean, se = float(difference.mean()), float(difference.std(ddof=1) / math.sqrt(count))
    reach = float(t.ppf(0.975, count - 1)) * se
    p = 1.0  # nothing to rank
    if difference.any():
        test: Any = wilcoxon(difference)
        p = float(test.pvalue)
    return Paired(mean, se, (mean - reach, mean + reach), p)


def holm(values: Sequence[float | None]) -> list[float | None]:
    """The p-values of several tests, adjusted so that all of them together err as often as one (Holm 1979).

    Where there is none there stays none.
    """
    order = sorted((p, number) for number, p in enumerate(values) if p is not None)
    adjusted: list[float | None] = [None] * len(values)
    largest = 0.0
    for rank, (p, number) in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - rank) * p))
        adjusted[number] = largest
    return adjusted
