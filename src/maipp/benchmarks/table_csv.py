"""Every mission of a table as one line of CSV, compressed so that the same numbers are the same bytes."""

import csv
import gzip
import io
from collections.abc import Sequence

import numpy as np

from maipp.benchmarks.table_rows import typed
from maipp.benchmarks.table_run import Line
from maipp.benchmarks.tables import TableSpec

_ABOUT = ("table", "row", "planner", "options", "agents", "budget", "range", "length_scale", "instance", "trial")


def table_csv(table: TableSpec, lines: Sequence[Line]) -> str:
    """Tidy CSV: a line for each instance and trial, with every metric; an empty range is global communication."""
    metrics = list(next(iter(lines[0].results.values())).values) if lines else []
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*_ABOUT, *metrics])
    for line in lines:
        scenario, row = line.part.scenario, line.row
        options = " ".join(f"{key}={typed(value)}" for key, value in row.options.items())
        for budget, result in line.results.items():
            where = "" if scenario.comm_range is None else f"{scenario.comm_range:g}"
            about = [table.name, row.name, row.planner, options, scenario.agents, f"{budget:g}", where]
            about.append(f"{scenario.length_scale:g}")
            precision = np.float64 if result.machine.get("precision") == "float64" else np.float32
            columns = [result.values[metric] for metric in metrics]
            for index in np.ndindex(columns[0].shape):
                writer.writerow([*about, *index, *(_shortest(precision(column[index])) for column in columns)])
    return out.getvalue()


def compressed(text: str) -> bytes:
    """The text as gzip without a time in it."""
    return gzip.compress(text.encode("utf-8"), compresslevel=9, mtime=0)


def _shortest(value: np.floating) -> str:
    """The fewest digits that give this number again at its own precision."""
    return str(value).removesuffix(".0")
