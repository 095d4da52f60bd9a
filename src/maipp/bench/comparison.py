"""Planners compared in pairs: the same worlds, one of them the reference."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from maipp.bench.evaluate import Evaluation, plain, worlds_of
from maipp.bench.paired import Paired, holm, paired
from maipp.errors import InputError


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
