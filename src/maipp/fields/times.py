"""Times in tables of measurements: clocks in many notations, and counted seconds."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from maipp.errors import InputError
from maipp.fields.csv_table import CsvTable, missing
from maipp.fields.sample_columns import named_column, words

_CLOCKS = ("time", "datetime", "timestamp", "utc")
_DATE = re.compile(r"(\d{1,4})([-/.])(\d{1,2})\2(\d{1,4})")
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?\s*(am|pm)?", re.IGNORECASE)


class Times(NamedTuple):
    """When each line of a table was written, NaN where that is missing."""

    seconds: Float[np.ndarray, " n"]  # since 1970 (UTC) of a clock, else of the table's own count
    columns: tuple[int, ...]  # that hold them


def times_of(table: CsvTable, header: Sequence[str], named: str | None = None) -> Times:
    """The times in the column `named`, or in those of customary names: a time, and a date where it has none.

    Clocks without a zone are taken as UTC. Raises InputError naming line and column of what is no time, and where days
    and months cannot be told apart.
    """
    column = named_column(table, header, named, "the time") if named is not None else _clock_column(table, header)
    cells = [row[column] for row in table.rows]
    present = [cell for cell in cells if not missing(cell)]
    if present and all(table.number(cell) is not None for cell in present):
        counted = table.numbers([column])[:, 0]
        # Milliseconds since 1970 as loggers write them: as seconds they would be of the year 30,000.
        return Times(counted / 1000 if np.nanmedian(np.abs(counted)) > 1e11 else counted, (column,))
    columns = [column]
    if present and not _DATE.search(present[0]) and not _iso(present[0]):
        dates = [i for i, name in enumerate(header) if words(name)[:1] == ["date"] and i != column]
        if len(dates) != 1:
            raise InputError(
                f"{table.path}: column '{header[column]}' has times without a date, and there is "
                f"{'no' if not dates else 'more than one'} date column; give whole times, such as 2026-05-01T10:00:00Z"
            )
        columns.append(dates[0])
        cells = [
            f"{row[dates[0]]} {cell}" if not missing(cell) else "" for row, cell in zip(table.rows, cells, strict=True)
        ]
    order = _order(table, cells, " ".join(header[i] for i in columns))
    seconds = np.array([_seconds(table, row, column, cell, order) for row, cell in enumerate(cells)])
    fractions = [i for i, name in enumerate(header) if words(name)[:2] == ["time", "fract"]]
    if len(fractions) == 1:
        seconds = seconds + np.nan_to_num(table.numbers(fractions)[:, 0])
        columns += fractions
    return Times(seconds, tuple(columns))


def utc(moment: datetime) -> float:
    """Seconds since 1970; a time without a zone is UTC."""
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _clock_column(table: CsvTable, header: Sequence[str]) -> int:
    found = [i for i, name in enumerate(header) if words(name)[:1] and words(name)[0] in _CLOCKS]
    found = [i for i in found if "fract" not in words(header[i])]
    if len(found) != 1:
        listed = ", ".join(header[i] for i in found) or f"none among {', '.join(header)}"
        raise InputError(f"{table.path}: the time must be in one column ({listed}); choose one with time=NAME")
    return found[0]


def _iso(cell: str) -> datetime | None:
    try:
        return datetime.fromisoformat(cell)
    except ValueError:
        return None


def _order(table: CsvTable, cells: Sequence[str], names: str) -> str:
    """Whether the day or the month comes first in dates that begin with neither the year: "dm" or "md"."""
    told = re.search(r"(dd?|mm?)[-/.](mm?|dd?)[-/.]yy", names.lower())
    if told:
        return "dm" if told[1].startswith("d") else "md"
    found = [
        (int(date[1]), date[2], int(date[3])) for cell in cells if (date := _DATE.search(cell)) and len(date[1]) < 3
    ]
    if not found or any(mark == "." or first > 12 for first, mark, _ in found):
        return "dm"
    if any(second > 12 for _, _, second in found):
        return "md"
    if all(first == second for first, _, second in found):
        return "dm"
    raise InputError(
        f"{table.path}: dates such as {found[0][0]}/{found[0][2]} may be day/month or month/day; write "
        "them as 2026-05-01, or name the column date (DD/MM/YYYY)"
    )


def _seconds(table: CsvTable, row: int, column: int, cell: str, order: str) -> float:
    if missing(cell):
        return float("nan")
    if (moment := _iso(cell)) is not None:
        return utc(moment)
    date, clock = _DATE.search(cell), _CLOCK.search(cell)
    try:
        if date is None or clock is None:
            raise ValueError
        first, second, third = int(date[1]), int(date[3]), int(date[4])
        if len(date[1]) == 4:
            year, month, day = first, second, third
        else:
            day, month = (first, second) if order == "dm" else (second, first)
            year = third + 2000 if third < 100 else third
        hour, late = int(clock[1]), (clock[4] or "").lower()
        hour = hour % 12 + 12 * (late == "pm") if late else hour
        second_of = float((clock[3] or "0").replace(",", "."))
        return utc(datetime(year, month, day, hour, int(clock[2]))) + second_of
    except ValueError:
        shown = cell if len(cell) <= 40 else f"{cell[:37]}..."
        raise InputError(
            f"{table.path}, line {table.lines[row]}, column {column + 1}: {shown!r} is no date and time; "
            "write it as 2026-05-01T10:00:00Z"
        ) from None
