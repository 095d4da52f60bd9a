"""Evaluations as jobs of a sweep: parts of the instances, done by the processes of a machine or of a cluster."""

import json
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from maipp.bench.evaluate import Evaluation, Progress, evaluate, fingerprint_of, plain
from maipp.bench.evaluations import merged
from maipp.bench.sweep.dealing import Where, run_sweep
from maipp.bench.sweep.jobs import Job, digest
from maipp.fields.raster import Raster
from maipp.foresight import ForesightName
from maipp.planners import make_planner
from maipp.problem import Shape
from maipp.scenario import Scenario

# Missions of a job, about: enough that starting one is not felt, few enough that several processes share a row.
_MISSIONS = 64


@dataclass(frozen=True)
class EvaluationJob:
    """One planner on some of the instances; also a whole row, to be taken `apart`."""

    planner: str
    scenario: Scenario
    options: Mapping[str, Any]
    first: int
    instances: int
    trials: int
    seed: int
    timing: bool
    shape: Shape
    field: Raster | None = None
    map: ForesightName | None = None

    @property
    def key(self) -> str:
        """A digest of what decides the result."""
        return digest(self.made_by)

    @property
    def kind(self) -> Hashable:
        """Planner, options and shape, which set the compiled programs."""
        return self.planner, json.dumps(plain(dict(self.options)), sort_keys=True), self.shape

    @property
    def words(self) -> str:
        """The planner and the instances."""
        return f"{self.planner}, instances {self.first}:{self.first + self.instances}"

    @property
    def made_by(self) -> Mapping[str, Any]:
        """The question, and the code, weights and libraries that answer it."""
        return {
            "planner": self.planner,
            "options": plain(dict(self.options)),
            "scenario": self.scenario.to_dict(),
            "instances": [self.first, self.instances],
            "trials": self.trials,
            "seed": self.seed,
            "timing": self.timing,
            "map": self.map,
            "code, weights and libraries": fingerprint_of(
                make_planner(self.planner, self.scenario, self.options), self.field
            ),
        }

    def apart(self) -> "list[EvaluationJob]":
        """The same in parts of about 64 missions; the first one times decisions, where they are to be timed."""
        parts = min(self.instances, math.ceil(self.instances * self.trials / _MISSIONS))
        ends = [self.first + self.instances * number // parts for number in range(parts + 1)]
        return [
            EvaluationJob(
                **{
                    **vars(self),
                    "first": begin,
                    "instances": end - begin,
                    "timing": self.timing and begin == self.first,
                }
            )
            for begin, end in zip(ends[:-1], ends[1:], strict=True)
        ]

    def compute(self, progress: Progress | None = None) -> Evaluation:
        """The evaluation. Raises `InputError` for bad input."""
        given = {name: value for name, value in vars(self).items() if name not in ("scenario", "planner")}
        return evaluate(self.scenario, self.planner, given.pop("options"), **given, progress=progress)


def evaluate_rows(
    rows: Sequence[EvaluationJob],
    keep: Callable[[int, Evaluation], None],
    *,
    where: Where,
    progress: Callable[[int], None] = lambda missions: None,
    note: Callable[[str], None] = lambda line: None,
) -> None:
    """Do the rows in parts; `keep` is given each row once it is whole, `progress` the missions done so far.

    Values do not depend on where that is, but for rounding. Raises `InputError` as `run_sweep` does.
    """
    jobs = [(number, job) for number, row in enumerate(rows) for job in row.apart()]
    left = [sum(number == row for number, _ in jobs) for row in range(len(rows))]
    done: list[list[Evaluation]] = [[] for _ in rows]
    missions = 0

    def keep_part(number: int, part: Evaluation) -> None:
        nonlocal missions
        row = jobs[number][0]
        done[row].append(part)
        left[row] -= 1
        missions += part.instances * part.trials
        progress(missions)
        if not left[row]:
            keep(row, merged(done[row])[0])

    queue: list[Job] = [job for _, job in jobs]
    run_sweep(queue, keep_part, where=where, note=note)
