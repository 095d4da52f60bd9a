"""Many evaluations: written to JSON files and read from them, put together from parts, compared in pairs.

In a pair both have met the same worlds, and one is the reference.
"""

import dataclasses
import itertools
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from maipp.bench.evaluate import Evaluation, plain, worlds_of
from maipp.engine.decision_time import DecisionTime
from maipp.errors import InputError
from maipp.files import read_text, write_atomic
from maipp.records import Value, Within, read_json
from maipp.scenario import Scenario
from maipp.typing import Float

FORMAT = "maipp-evaluations"  # of the JSON

_Count = Annotated[int, Within(least=1)]
_Number = Annotated[int, Within(least=0, wide=True)]


def save_evaluations(
    evaluations: Sequence[Evaluation], path: str | os.PathLike[str], comparisons: Sequence[Mapping[str, Any]] = ()
) -> None:
    """Write the evaluations as JSON so that the file is either the whole new one or untouched.

    Raises `InputError` where the file cannot be written.
    """
    write_atomic(path, to_json(evaluations, comparisons))


def to_json(evaluations: Sequence[Evaluation], comparisons: Sequence[Mapping[str, Any]] = ()) -> str:
    """The evaluations as JSON text, and comparisons of them (`Comparison.to_dict`) where there are any."""
    document = {"format": FORMAT, "evaluations": [evaluation.to_dict() for evaluation in evaluations]}
    document |= {"comparisons": [*comparisons]} if comparisons else {}
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def read_evaluations(path: str | os.PathLike[str]) -> list[Evaluation]:
    """The evaluations of a file that `save_evaluations` wrote. Raises `InputError` for any other."""
    text = read_text(path, "evaluations", "a file that `maipp evaluate --json` wrote")
    whole = read_json(text, str(Path(path)), strict=True)
    if whole.mapping().get("format") != FORMAT:
        whole.at("format").wrong(f"is not {FORMAT!r}; give a file that `maipp evaluate --json` wrote")
    return [_read(each) for each in whole["evaluations"].items()]


def _read(row: Value) -> Evaluation:
    instances, trials = row["instances"].fit(_Count), row["trials"].fit(_Count)
    time = row["decision_ms"]
    return Evaluation(
        scenario=row["scenario"].make(Scenario.create, row["scenario"].mapping()),
        planner=row["planner"].fit(str),
        options=row["options"].mapping(),
        instances=instances,
        # Older files hold neither of these: they began at the first instance, made by what nobody knows any more.
        first=row["first"].fit(_Number) if "first" in row else 0,
        fingerprint=row["fingerprint"].fit(str) if "fingerprint" in row else "",
        trials=trials,
        seed=row["seed"].fit(_Number),
        values={name: _read_values(row["values"][name], instances, trials) for name in row["values"].mapping()},
        message_bytes=row["message_bytes"].fit(_Number),
        decision_ms=None if time.value is None else time.make(DecisionTime, time.mapping()),
        wall_s=row["wall_s"].fit(float),
        machine=row["machine"].mapping(),
        versions=row["versions"].mapping(),
    )


def _read_values(value: Value, instances: int, trials: int) -> np.ndarray:
    rows = [each.fit(list[float]) for each in value.items(count=instances)]
    for number, row in enumerate(rows):
        if len(row) != trials:
            value.at(f"[{number}]").wrong(f"has {len(row)} entries; give {trials}, one for each trial")
    return np.array(rows, np.float64)


def merged(parts: Sequence[Evaluation]) -> list[Evaluation]:
    """Evaluations of the same planner in the same scenario, over other instances, as one each.

    Raises `InputError` for instances that several parts hold or that are missing between two, and for parts that
    different code, weights or libraries made.
    """
    groups: dict[str, list[Evaluation]] = {}
    for part in parts:
        groups.setdefault(_what(part), []).append(part)
    return [_joined(sorted(group, key=lambda part: part.first)) for group in groups.values()]


def what(planner: str, options: Mapping[str, Any], scenario: Scenario, seed: int, trials: int) -> str:
    """What an evaluation is of, whatever its instances: equal for two that can be put together."""
    return json.dumps([planner, plain(dict(options)), scenario.to_dict(), seed, trials], sort_keys=True)


def _what(part: Evaluation) -> str:
    return what(part.planner, part.options, part.scenario, part.seed, part.trials)


def find(
    known: Sequence[Evaluation],
    wanted: str,
    first: int,
    instances: int,
    fingerprint: str,
    *,
    timing: bool,
    map: str | None = None,
) -> Evaluation | None:
    """Of those that are known the one that is `wanted` (`what`), over these instances and made by the same code."""
    for each in known:
        same = (each.first, each.instances) == (first, instances) and each.fingerprint == fingerprint != ""
        lacks = (timing and each.decision_ms is None) or (map is not None and f"{map}_rmse" not in each.values)
        if same and _what(each) == wanted and not lacks:
            return each
    return None


def _joined(parts: list[Evaluation]) -> Evaluation:
    first = parts[0]
    for one, other in itertools.pairwise(parts):
        end = one.first + one.instances
        if other.first != end:
            first, last = sorted((other.first, end))
            told = "are in none of the parts" if other.first > end else "are in more than one of the parts"
            raise InputError(f"--merge: instances {first}:{last} of {one.planner} {told}")
        if one.fingerprint != other.fingerprint:
            raise InputError(
                f"--merge: parts of {one.planner} were made by different code, weights or libraries "
                f"({_versions(one, other)}); evaluate them again with the same"
            )
    times = [part.decision_ms for part in parts if part.decision_ms is not None]
    machines = [part.machine for part in parts]
    same = all(machine == machines[0] for machine in machines)
    return dataclasses.replace(
        parts[0],
        instances=sum(part.instances for part in parts),
        values={name: np.concatenate([part.values[name] for part in parts]) for name in parts[0].values},
        decision_ms=times[0] if times else None,
        wall_s=sum(part.wall_s for part in parts),
        machine=machines[0] if same else {"several": machines},
    )


def _versions(one: Evaluation, other: Evaluation) -> str:
    names = [name for name in one.versions if one.versions[name] != other.versions.get(name)]
    told: list[Any] = [f"{name} {one.versions[name]} and {other.versions.get(name)}" for name in names]
    return ", ".join(told) or "the versions are the same"


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
