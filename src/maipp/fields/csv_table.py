"""CSV text as people have it, split into a header and cells: several separators and encodings, comments, quotes."""

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from maipp.errors import InputError
from maipp.fields.raster_terms import X_NAMES, Y_NAMES

_SEPARATORS = (";", "\t", ",")
_DEEPEST, _FEW = 200, 20  # lines among which the first of a table is looked for, and that tell how wide it is
# What a line of numbers may begin with; a map's first line may be without a value throughout.
_NUMBER_FIRST = re.compile(r"[+-]?([.,]?\d|(nan|inf)$)", re.IGNORECASE)
_MISSING = {"", "-", "--", "na", "n/a", "nan", "null", "none", "nil", "missing", "nd", "n.d.", "bdl", "<lod", "<mdl"}
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?", re.IGNORECASE | re.ASCII)


class CsvTable(NamedTuple):
    """The cells of a CSV file, stripped; every row has as many as the header."""

    path: Path
    header: list[str] | None  # None where the first line holds numbers
    header_line: int  # the line that the header stands on; 0 without one
    rows: list[list[str]]  # at least one
    lines: list[int]  # the line that each row begins on, counting from 1
    decimal_comma: bool  # whether a comma in a cell may be a decimal one

    def number(self, cell: str) -> float | None:
        """The number in a cell, inf included; None where it is none."""
        if self.decimal_comma and cell.count(",") == 1 and "." not in cell:
            cell = cell.replace(",", ".")
        return float(cell) if _NUMBER.fullmatch(cell) else None

    def numbers(self, columns: Sequence[int], rows: Sequence[int] | None = None) -> Float[np.ndarray, "n k"]:
        """The numbers in these columns, NaN where one is missing. Raises InputError naming line and column."""
        rows = range(len(self.rows)) if rows is None else rows
        return np.array([[self._number(row, column) for column in columns] for row in rows])

    def _number(self, row: int, column: int) -> float:
        cell = self.rows[row][column]
        number = float("nan") if missing(cell) else self.number(cell)
        if number is None:
            shown = cell if len(cell) <= 40 else cell[:37] + "..."
            raise InputError(f"{self.path}, line {self.lines[row]}, column {column + 1}: {shown!r} is not a number")
        return number


def missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return cell.lower() in _MISSING


def read_table(path: Path) -> CsvTable:
    """The table in a text file. Raises InputError naming file and line for anything that is none."""
    text = _text(path)
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    separator: str | None = None
    if lines and lines[0][1].strip().strip('"').lower() in {f"sep={mark}" for mark in _SEPARATORS}:
        separator = lines[0][1].strip().strip('"')[-1]  # a spreadsheet's own hint
        lines = lines[1:]
    comments = [(number, line.lstrip().lstrip("#")) for number, line in lines if line.lstrip().startswith("#")]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(f"{path}: the file is empty; no line of numbers in it")
    if separator is None:
        separator = _separator(lines)
    try:
        numbered = list(_rows(lines, separator))
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error})") from None
    numbered = numbered[_first_row([cells for _, cells in numbered]) :]
    rows, numbers = [], []
    for number, cells in numbered:
        while cells and len(cells) > (len(rows[0]) if rows else len(cells)) and not cells[-1]:
            cells.pop()  # spreadsheets end lines with empty cells
        rows.append(cells)
        numbers.append(number)
    header, header_line = None, 0
    if not _holds_numbers(rows[0]):
        header, header_line = rows.pop(0), numbers.pop(0)
    elif (named := _commented_header(comments, separator, len(rows[0]), numbers[0])) is not None:
        header_line, header = named
    if not rows:
        raise InputError(f"{path}: there is no line of numbers below the header")
    width, before = len(header or rows[0]), "the header names" if header else "the lines before have"
    for number, cells in zip(numbers, rows, strict=True):
        if len(cells) != width:
            comma = separator == "," and len(cells) > width
            hint = "; numbers with a decimal comma need a semicolon between the columns" if comma else ""
            raise InputError(f"{path}, line {number}: {len(cells)} columns where {before} {width}{hint}")
    return CsvTable(path, header, header_line, rows, numbers, separator in (";", "\t"))


def _separator(lines: list[tuple[int, str]]) -> str | None:
    """What stands between cells: what the first line has, or below a line that has none nearly all do."""
    first, last = (len(lines[index][1].split()) for index in (0, -1))
    blanks = first == last > 1
    for count in (1, min(len(lines), _DEEPEST)):
        for mark in _SEPARATORS:
            with_it = sum(mark in line for _, line in lines[:count])
            if with_it > 0.5 * count and (count == 1 or not blanks):
                return mark
    return None


def _first_row(rows: list[list[str]]) -> int:
    """Where the table begins: below a preamble of an instrument, whose lines are shorter, or have cells empty."""
    width = max((len(_trimmed(row)) for row in rows[1:_FEW]), default=0)
    if not rows or _holds_numbers(rows[0]) or (all(rows[0]) and len(rows[0]) >= width):
        return 0
    best, most = 0, 1
    for index, row in enumerate(rows[:_DEEPEST]):
        below = rows[index + 1 : index + 3]  # one of them may hold the units
        names = _trimmed(row)
        fits = len(names) > most and all(names) and not _holds_numbers(row)
        if fits and any(map(_holds_numbers, below)) and all(len(_trimmed(each)) <= len(names) for each in below):
            best, most = index, len(names)
    return best


def _trimmed(row: list[str]) -> list[str]:
    """The cells up to the last that is not empty."""
    return row[: max((index + 1 for index, cell in enumerate(row) if cell), default=0)]


def _holds_numbers(row: list[str]) -> bool:
    return any(_NUMBER_FIRST.match(cell) for cell in row)


def _text(path: Path) -> str:
    """The file's text: UTF-8 or UTF-16, and else what old spreadsheets write."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "cp1252", "latin-1"):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
        break
    raise InputError(f"{path}: not text; save it as a plain CSV")


def _rows(lines: list[tuple[int, str]], separator: str | None) -> Iterator[tuple[int, list[str]]]:
    """Cells of each row, and the line that it begins on."""
    if separator is None:
        for number, line in lines:
            yield number, [cell.strip("\"'") for cell in line.split()]
        return
    begun: list[int] = []

    def texts() -> Iterator[str]:
        for number, line in lines:
            begun.append(number)
            yield line + "\n"

    # A quoted cell may go on over several lines; the row begins on the first of them.
    for cells in csv.reader(texts(), delimiter=separator, skipinitialspace=True):
        first = begun[0]
        begun.clear()
        yield first, [cell.strip().strip("\"'").strip() for cell in cells]


def _commented_header(
    comments: list[tuple[int, str]], separator: str | None, width: int, before: int
) -> tuple[int, list[str]] | None:
    """A header behind a comment sign above the numbers: one that names as many columns, x and y among them."""
    for number, line in reversed(comments):
        cells = [cell.strip().strip("\"'") for cell in line.split(separator)]
        lower = {cell.lower() for cell in cells}
        if number < before and len(cells) == width and lower & set(X_NAMES) and lower & set(Y_NAMES):
            return number, cells
    return None
