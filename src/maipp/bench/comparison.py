"""Planners compared in pairs: the same worlds, one of them the reference."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from maipp.bench.evaluate import Evaluation, plain, worlds_of
from maipp.errors import InputError
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


class Comparison(NamedTuple):
    """How one evaluation differs from that of the reference in the same worlds, in one metric."""

    evaluation: Evaluation
    reference: Evaluation
    metric: str
    difference: Paired
    holm: float | None  # its p-value, adjusted for all comparisons in this metric

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and strings, ready for JSON."""
        test = self.difference
        return {
            "planner": label(self.evaluation, self.reference),
            "reference": label(self.reference, self.evaluation),
            "scenario": self.evaluation.scenario.to_dict(),
            "metric": self.metric,
            "mean": test.mean,
            "se": test.se,
            "interval": None if test.interval is None else list(test.interval),
            "p": test.p,
            "holm": self.holm,
        }


def compare(evaluations: Sequence[Evaluation], reference: str) -> list[Comparison]:
    """Every evaluation minus that of the reference planner in the same worlds, metric by metric.

    A metric that is the same for all is left out. Raises `InputError` where the reference has no evaluation, or more
    than one, in the worlds of another.
    """
    pairs = [(each, _reference_of(each, evaluations, reference)) for each in evaluations if each.planner != reference]
    found: list[Comparison] = []
    for metric in evaluations[0].values if evaluations else ():
        rows = [(each.values[metric], other.values[metric]) for each, other in pairs]
        if all(np.array_equal(a.mean(axis=1), b.mean(axis=1)) for a, b in rows):
            continue
        tests = [paired(*row) for row in rows]
        adjusted = holm([test.p for test in tests])
        found += [Comparison(*pair, metric, test, p) for pair, test, p in zip(pairs, tests, adjusted, strict=True)]
    return found


def label(evaluation: Evaluation, *others: Evaluation) -> str:
    """The planner, and those of its options in which it differs from others of the same name."""
    alike = [other for other in others if other.planner == evaluation.planner]
    names = [
        name
        for name, value in evaluation.options.items()
        if any(plain(other.options.get(name)) != plain(value) for other in alike)
    ]
    return " ".join([evaluation.planner, *(f"{name}={evaluation.options[name]}" for name in names)])


def _reference_of(evaluation: Evaluation, evaluations: Sequence[Evaluation], reference: str) -> Evaluation:
    same = [other for other in evaluations if other.planner == reference]
    if not same:
        names = ", ".join(dict.fromkeys(other.planner for other in evaluations))
        raise InputError(f"--reference: {reference} is none of the planners compared, {names}")
    found = [other for other in same if worlds_of(other) == worlds_of(evaluation)]
    if len(found) != 1:
        how = "was not evaluated" if not found else f"was evaluated {len(found)} times, with other options,"
        worlds = f"seed {evaluation.seed}, instances {evaluation.first}:{evaluation.first + evaluation.instances}"
        raise InputError(f"--reference: {reference} {how} in the worlds of {evaluation.planner} ({worlds})")
    return found[0]
