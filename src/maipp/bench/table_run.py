"""Filling a table: the cells that are not there yet, one after the other, each kept as soon as it is done."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from maipp.bench.cells import Cell, CellResult
from maipp.bench.rows import Row
from maipp.bench.sweep.dealing import HERE, Where, run_sweep
from maipp.bench.tables import Part, Sample, TableSpec
from maipp.errors import InputError

# Cell, its number among those to compute, how many these are, and whether it is done: False when somebody begins it.
Report = Callable[[Cell, int, int, bool], None]


@dataclass(frozen=True)
class Line:
    """A row of one part of a table, with what its cells came to by column."""

    row: Row
    part: Part
    results: dict[float, CellResult]  # by column; every column of the table


def cell(table: TableSpec, part: Part, row: Row, column: float, sample: Sample) -> Cell:
    """The cell of a row in a column."""
    trials = min(sample.trials, row.trials or sample.trials)
    scenario, shape = table.scenario(part, column), table.shape(part)
    return Cell(row, scenario, sample.instances, trials, sample.seed, shape, table.worlds)


def cells(table: TableSpec, rows: Sequence[Row], sample: Sample) -> Iterator[Cell]:
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


def read(table: TableSpec, folder: Path, sample: Sample) -> list[Line]:
    """The rows of a table of which the folder has every cell, made by the code and the weights of now."""
    lines = []
    for part in table.parts:
        for row in table.rows:
            found = {column: cell(table, part, row, column, sample).load(folder) for column in table.columns}
            results = {column: result for column, result in found.items() if result is not None}
            if len(results) == len(found):
                lines.append(Line(row, part, results))
    return lines
