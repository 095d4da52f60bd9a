"""The files that a table leaves in its folder: CSV, figure, Markdown."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from maipp.bench.cells import Line, Sample, read
from maipp.bench.drawings import save_figure
from maipp.bench.output import compressed, csv_text
from maipp.bench.table_figure import draw_table
from maipp.bench.table_page import brief_page, table_page
from maipp.bench.tables import TableSpec
from maipp.errors import InputError
from maipp.files import write_atomic

BRIEF = "brief"  # folder of the short forms, for pages that have more to say than results

_ABOUT = ("table", "row", "planner", "options", "agents", "budget", "range", "length_scale")
_COLUMNS = ("agents", "budget", "comm_range", "length_scale")  # keys of the scenario that are among them


def write_table(table: TableSpec, folder: Path, sample: Sample, reference: str) -> list[Path]:
    """Write NAME.csv.gz, NAME.png, NAME.md and brief/NAME.md of all rows that the folder has every cell of.

    Gives their paths.
    Raises `InputError` where there is no such row, or a file cannot be written.
    """
    lines = read(table, folder, sample)
    if not lines:
        raise InputError(
            f"{folder}: no row of {table.name} has all its cells yet; run `maipp benchmark {table.typed or table.name}`"
        )
    csv, figure, page = (folder / f"{table.name}{suffix}" for suffix in (".csv.gz", ".png", ".md"))
    write_atomic(csv, compressed(table_csv(table, lines)))
    save_figure(draw_table(table, lines), figure)
    text = table_page(table, lines, sample, out=folder.name, reference=reference, files=(figure.name, csv.name))
    write_atomic(page, text)
    brief = folder / BRIEF / f"{table.name}.md"
    brief.parent.mkdir(exist_ok=True)
    write_atomic(brief, brief_page(table, lines, sample, out=folder.name))
    return [csv, figure, page, brief]


def table_csv(table: TableSpec, lines: Sequence[Line]) -> str:
    """Tidy CSV: a line for each instance and trial, with every metric; an empty range is global communication.

    Numbers have the fewest digits that give them again at their own precision.
    """
    own = [table.column] * (table.column not in _COLUMNS)
    metrics = list(next(iter(lines[0].results.values())).values) if lines else []

    def rows() -> Iterator[list[object]]:
        for line in lines:
            row = line.row
            for column, result in line.results.items():
                scenario = table.scenario(line.part, column)
                reach = "" if scenario.comm_range is None else f"{scenario.comm_range:g}"
                about = [table.name, row.name, row.planner, row.typed_options, scenario.agents]
                about += [f"{max(scenario.budgets):g}", reach, f"{scenario.length_scale:g}"]
                about += [f"{column:g}"] * (own != [])
                precision = np.float64 if result.machine.get("precision") == "float64" else np.float32
                for index, missions in result.missions(metrics):
                    yield [*about, *index, *(str(precision(value)).removesuffix(".0") for value in missions)]

    return csv_text((*_ABOUT, *own, "instance", "trial", *metrics), rows())
