"""The cells of a table: missions of a row in a column, run by a sweep, each kept in a file that says what made it."""

import json
import time
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from maipp.bench.evaluate import evaluate, prior_missions, refuse_values, scored
from maipp.bench.provenance import machine, planner_fingerprint, versions
from maipp.bench.sweep.dealing import HERE, Where, run_sweep
from maipp.bench.sweep.jobs import digest
from maipp.bench.tables import Row, SampleSize, TablePart, TableSpec
from maipp.errors import InputError
from maipp.files import make_folder, write_atomic
from maipp.planners import make_planner
from maipp.planners.options import values_of
from maipp.problem import Shape
from maipp.scenario import Scenario
from maipp.typing import Float

CELLS = "cells"  # folder of the files, below that of the run
_FORMAT = "maipp-cell"


@dataclass(frozen=True)
class CellResult:
    """What a cell came to."""

    values: Mapping[str, Float[np.ndarray, "instances trials"]]  # per metric; the fields of `Metrics`
    wall_s: float
    machine: Mapping[str, Any]
    versions: Mapping[str, str]


@dataclass(frozen=True)
class Cell:
    """The missions of one row at one budget."""

    row: Row
    scenario: Scenario
    instances: int
    trials: int
    seed: int
    shape: Shape  # that it is compiled for; whatever that is, the numbers are the same up to rounding
    worlds: str = "mixture"  # of `maipp.bench.tables.WORLDS`

    @property
    def budget(self) -> float:
        """Of each agent, domain units."""
        return max(self.scenario.budgets)

    @property
    def kind(self) -> Hashable:
        """Equal for cells that run the same compiled program."""
        return self.row.name, self.shape

    @property
    def words(self) -> str:
        """What it is, for a line about it."""
        reach = "" if self.scenario.comm_range is None else f", range {self.scenario.comm_range:g}"
        return f"{self.row.name}, budget {self.budget:g}{reach}"

    @property
    def made_by(self) -> Mapping[str, Any]:
        """Everything that decides the numbers, as plain JSON. Raises `InputError` for bad options or weights."""
        return self._made_by

    @cached_property
    def _made_by(self) -> dict[str, Any]:
        planner = make_planner(self.row.planner, self.scenario, self.row.options)
        made_by = {
            "scenario": self.scenario.to_dict(),
            "planner": self.row.planner,
            "options": values_of(planner),
            "instances": self.instances,
            "trials": self.trials,
            "seed": self.seed,
        }
        if self.worlds == "prior":
            made_by["worlds"] = "prior"
        return json.loads(json.dumps(made_by | planner_fingerprint(planner), default=repr))

    def __getstate__(self) -> dict[str, Any]:
        """All but `made_by`: whoever unpickles it works that out anew."""
        return {name: value for name, value in self.__dict__.items() if name != "_made_by"}

    @property
    def key(self) -> str:
        """Its name, with a digest of all that decides the numbers."""
        return f"{self.row.name}.B{self.budget:g}.{digest(self.made_by)}"

    @property
    def file(self) -> str:
        """Name of its file. What was made differently has another name, so a stale file is never read."""
        return f"{self.key}.json"

    def load(self, folder: Path) -> CellResult | None:
        """What was computed before; None where there is no such file, or one that is damaged."""
        try:
            document = json.loads((folder / CELLS / self.file).read_text(encoding="utf-8"))
            if document["format"] != _FORMAT or document["made_by"] != self.made_by:
                return None
            values = {metric: np.asarray(rows, np.float64) for metric, rows in document["values"].items()}
            shape = (self.instances, self.trials)
            if any(array.shape != shape or not np.isfinite(array).all() for array in values.values()):
                return None
            return CellResult(values, float(document["wall_s"]), document["machine"], document["versions"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def compute(self) -> CellResult:
        """Run the missions."""
        if self.worlds == "prior":
            begun = time.perf_counter()
            planner = make_planner(self.row.planner, self.scenario, self.row.options)
            missions = prior_missions(self.scenario, planner, self.seed, self.instances, self.trials, self.shape)
            values = scored(planner, missions, self.seed, self.trials)
            return CellResult(values, time.perf_counter() - begun, machine(), versions())
        result = evaluate(
            self.scenario,
            self.row.planner,
            self.row.options,
            instances=self.instances,
            trials=self.trials,
            seed=self.seed,
            timing=False,
            shape=self.shape,
        )
        return CellResult(result.values, result.wall_s, result.machine, result.versions)

    def save(self, result: CellResult, folder: Path) -> None:
        """Write the file, whole or not at all.

        Raises `InputError` where it cannot be written, and for a value that is not a finite number.
        """
        refuse_values(result.values)
        make_folder(folder / CELLS)
        document = {
            "format": _FORMAT,
            "made_by": self.made_by,
            "wall_s": round(result.wall_s, 3),
            "machine": dict(result.machine),
            "versions": dict(result.versions),
            "values": {metric: values.tolist() for metric, values in result.values.items()},
        }
        write_atomic(folder / CELLS / self.file, json.dumps(document, allow_nan=False) + "\n")


# Cell, its number among those to compute, how many these are, and whether it is done: False when somebody begins it.
Report = Callable[[Cell, int, int, bool], None]


def cell(table: TableSpec, part: TablePart, row: Row, column: float, sample: SampleSize) -> Cell:
    """The cell of a row in a column."""
    trials = min(sample.trials, row.trials or sample.trials)
    scenario, shape = table.scenario(part, column), table.shape(part)
    return Cell(row, scenario, sample.instances, trials, sample.seed, shape, table.worlds)


def cells(table: TableSpec, rows: Sequence[Row], sample: SampleSize) -> Iterator[Cell]:
    """All cells of these rows, those that share a compilation next to each other."""
    for part in table.parts:
        for row in rows:
            for column in table.columns:
                yield cell(table, part, row, column, sample)


def share(every: Sequence[Cell], process: int, processes: int) -> list[Cell]:
    """The cells of one of several processes, dealt out to and fro so that each gets long and short budgets.

    Raises `InputError` for a process that is none of them.
    """
    if not 0 <= process < processes:
        raise InputError(f"--process-id: {process} is none of {processes}; give 0 to {processes - 1}")
    return [one for i, one in enumerate(every) if min(i % (2 * processes), ~i % (2 * processes)) == process]


def fill(
    every: Sequence[Cell],
    folder: Path,
    report: Report = lambda *_: None,
    *,
    where: Where = HERE,
    note: Callable[[str], None] = lambda line: None,
) -> int:
    """Compute and keep the cells that the folder lacks; gives how many these were.

    An interrupt loses the cells that are under way, no other, wherever they are computed; `note` hears of workers that
    are no use. Raises `InputError` for a bad option before any work, where a file cannot be written, and where the
    sweep does.
    """
    missing = [one for one in every if one.load(folder) is None]

    def keep(number: int, result: CellResult) -> None:
        if missing[number].load(folder) is None:  # another process or machine may have done it by now
            missing[number].save(result, folder)
        report(missing[number], number, len(missing), True)

    def begun(number: int) -> None:
        report(missing[number], number, len(missing), False)

    run_sweep(missing, keep, where=where, begun=begun, note=note)
    return len(missing)
