"""`maipp benchmark table1` to `table4`: the paper's tables, with baselines that they lack."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro
from rich.console import Console

from maipp.bench.cells import Cell, cells, fill, share
from maipp.bench.evaluate import check_counts
from maipp.bench.sweep.dealing import Where
from maipp.bench.table_page import write_table
from maipp.bench.tables import TABLES, SampleSize, TableSpec, read_table
from maipp.cli.notes import counting_bar, notes_console
from maipp.cli.sweep_flags import SweepFlags
from maipp.errors import InputError
from maipp.records import unknown
from maipp.seeds import check_seed

INTERRUPTED = 130


@dataclass(frozen=True)
class TableFlags(SweepFlags):
    """Fill a table, or go on filling it; the same command again computes only what is missing."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """folder to write to; made if need be. What is computed there already is kept"""

    quick: bool = False
    """30 instances x 1 trial, without receding-horizon-joint"""

    instances: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: 30)")] = None
    """worlds (ground truth and start)"""

    trials: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: 10)")] = None
    """runs per world, each with fresh roadmaps and fresh randomness"""

    seed: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: 0)")] = None
    """seed of the worlds"""

    planners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ROW|PLANNER [...]", help_behavior_hint="")] = ()
    """rows to compute, by their own name or their planner's; left out: all but intent-paths-reencode"""

    reference: Annotated[str | None, tyro.conf.arg(metavar="ROW", help_behavior_hint="")] = None
    """row that the others are paired with; left out: the table's own"""

    process_id: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """number of this process, from 0, where several fill one folder; then only cells are written"""

    processes: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """processes in all"""

    table: ClassVar[str]

    def spec(self) -> TableSpec:
        """The table. Raises `InputError` for a file that is none."""
        return TABLES[self.table]


@dataclass(frozen=True, kw_only=True)
class TableFile(TableFlags):
    """A table of your own, from a YAML file (docs/benchmark.md)."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """the table: its rows, columns, worlds and trials"""

    def spec(self) -> TableSpec:
        """The table. Raises `InputError` for a file that is none."""
        return read_table(self.file)


@dataclass(frozen=True)
class Table1(TableFlags):
    """Table I: three agents, budgets 2 to 5."""

    table: ClassVar[str] = "table1"


@dataclass(frozen=True)
class Table2(TableFlags):
    """Table II: ten agents, budgets 2 to 4."""

    table: ClassVar[str] = "table2"


@dataclass(frozen=True)
class Table3(TableFlags):
    """Table III: intents over paths of 3, 6 and 9 nodes, budgets 3 and 4."""

    table: ClassVar[str] = "table3"


@dataclass(frozen=True)
class Table4(TableFlags):
    """Table IV: communication ranges 0.3, 0.6 and global, budgets 2 to 4."""

    table: ClassVar[str] = "table4"


def run(flags: TableFlags) -> int:
    """Fill the table and write its files; gives 130 when interrupted. Raises `InputError` for what is wrong."""
    table = flags.spec()
    sample = _sample(flags, table)
    rows = table.chosen(flags.planners)
    if flags.quick and not flags.planners:
        rows = tuple(row for row in rows if row.quick)
    every = list(cells(table, rows, sample))
    reference = flags.reference or table.reference
    if reference not in [row.name for row in table.rows]:
        raise InputError(f"--reference: {unknown('row', reference, [row.name for row in table.rows])}")
    if (flags.process_id is None) != (flags.processes is None):
        raise InputError("--process-id and --processes: only one is given; give both, or neither")
    if flags.processes is not None and flags.process_id is not None:
        every = share(every, flags.process_id, flags.processes)
    where = flags.where()
    notes = notes_console()
    begun = time.monotonic()
    try:
        computed = _fill(table, every, flags.out, where, notes)
    except KeyboardInterrupt:
        notes.print("interrupted; the same command goes on with the cells that are missing")
        return INTERRUPTED
    minutes = f"; {(time.monotonic() - begun) / 60:.1f} minutes" if computed else ""
    notes.print(f"{len(every)} cells: {computed} computed, {len(every) - computed} found in {flags.out}{minutes}")
    if flags.processes is not None:
        return 0
    for path in write_table(table, flags.out, sample, reference):
        print(f"wrote {path}")
    return 0


def _sample(flags: TableFlags, table: TableSpec) -> SampleSize:
    """How many missions. Raises `InputError` where the flags contradict each other."""
    if flags.quick and (flags.instances, flags.trials) != (None, None):
        raise InputError("--quick: is 30 instances x 1 trial; leave out --instances and --trials")
    sample = table.quick_sample if flags.quick else table.sample
    given = {name: getattr(flags, name) for name in ("instances", "trials", "seed") if getattr(flags, name) is not None}
    check_counts("--", **{name: value for name, value in given.items() if name != "seed"})
    check_seed(sample.seed if flags.seed is None else flags.seed, "--seed")
    return sample._replace(**given)


def _fill(table: TableSpec, every: list[Cell], folder: Path, where: Where, notes: Console) -> int:
    """Compute what is missing, with a bar, or a line for each cell where there is no terminal."""
    with counting_bar(notes, "cells") as bar:
        task = bar.add_task(table.name, total=None)
        begun: set[int] = set()

        def report(cell: Cell, number: int, count: int, done: bool) -> None:
            """Show where the work is."""
            if not notes.is_terminal and number not in begun:
                notes.print(f"cell {len(begun) + 1} of {count}: {cell.words}")
            begun.add(number)
            bar.update(task, total=count, advance=int(done), description=cell.words)

        return fill(every, folder, report, where=where, note=lambda line: notes.print(line, markup=False))
