"""What a sensor or laboratory wrote down as a value: numbers, and limits of what it can tell."""

import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from maipp.fields.csv_table import CsvTable, missing

_LIMIT = re.compile(r"([<>≤≥])\s*=?\s*(.+)")
_SHOWN = 5  # lines that are named


def reading(table: CsvTable, cell: str) -> float | None:
    """The value in a cell; of one below detection (`<0.5`) half the limit, above the range (`>200`) the limit.

    None where it is none. Half the limit is the customary substitute (Helsel 1990).
    """
    number = table.number(cell)
    if number is None and (limit := _LIMIT.fullmatch(cell)) is not None:
        number = table.number(limit[2].strip())
        return number if number is None or limit[1] in ">≥" else number / 2
    return number


def readings(table: CsvTable, column: int) -> tuple[Float[np.ndarray, " n"], list[str]]:
    """The values of a column, NaN where one is missing, and what to tell of them. InputError naming line and column."""
    values, limits = np.full(len(table.rows), np.nan), {"<": list[int](), ">": list[int]()}
    for row, cells in enumerate(table.rows):
        cell = cells[column]
        if not missing(cell):
            value = reading(table, cell)
            values[row] = table.numbers([column], rows=[row])[0, 0] if value is None else value
            if value is not None and cell[0] in "<≤>≥":
                limits["<" if cell[0] in "<≤" else ">"].append(table.lines[row])
    notes = []
    if limits["<"]:
        notes.append(f"{told_lines(limits['<'])} below detection; half the limit is taken")
    if limits[">"]:
        notes.append(f"{told_lines(limits['>'])} above the range; the limit is taken")
    return values, notes


def told_lines(lines: Sequence[int]) -> str:
    """The number of some lines of a file and which they are, the first few by their numbers."""
    shown = ", ".join(str(line) for line in lines[:_SHOWN])
    more = f" and {len(lines) - _SHOWN} more" if len(lines) > _SHOWN else ""
    return f"{len(lines)} line{'s' if len(lines) > 1 else ''} ({shown}{more})"
