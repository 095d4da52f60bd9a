"""Evaluations written to JSON files and read from them, and parts of one evaluation put together."""

import dataclasses
import itertools
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from maipp.bench.evaluate import Evaluation, plain
from maipp.bench.latency import DecisionTime
from maipp.errors import InputError
from maipp.files import read_text, write_atomic
from maipp.records import Value, Within, read_json
from maipp.scenario import Scenario

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
