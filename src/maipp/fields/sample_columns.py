"""Which columns of a table of samples hold what: named by the person, or known by their customary names."""

import re
from collections.abc import Sequence

from maipp.errors import InputError
from maipp.fields.csv_table import CsvTable, missing
from maipp.fields.raster_terms import X_NAMES, Y_NAMES
from maipp.fields.readings import reading

_NAMES = {"x": (*X_NAMES, "long", "lng", "east"), "y": (*Y_NAMES, "north")}
DEGREES = ("lon", "longitude", "long", "lng", "lat", "latitude")
# What may follow such a name: `lon_deg`, `x (m)`, `Latitude [decimal degrees]`.
_UNITS = {"deg", "degree", "degrees", "dd", "decimal", "m", "metre", "metres", "meter", "meters", "wgs84", "utm"}
_UNITS |= {"north", "east", "n", "e"}
# Columns that number or date the lines: never taken for the value unless named.
TIMES = {"time", "date", "datetime", "timestamp", "t", "year", "month", "day", "hour", "minute", "second", "utc"}
_NO_VALUES = {"id", "fid", "no", "nr", "number", "index", "point", "station", "sample", "line", "site"} | TIMES


def words(name: str) -> list[str]:
    """The words of a column's name in lower case."""
    return re.findall(r"[a-z0-9]+", name.lower())


def position_column(table: CsvTable, header: Sequence[str], named: str | None, axis: str) -> int:
    """The column of an axis, x or y: the one named, or the one with a customary name."""
    if named is not None:
        return named_column(table, header, named, axis)
    customary = _NAMES[axis]
    exact = [i for i, name in enumerate(header) if name.strip().lower() in customary]
    loose = [
        i
        for i, name in enumerate(header)
        if words(name)[:1] and words(name)[0] in customary and set(words(name)[1:]) <= _UNITS
    ]
    for found in (exact, loose):
        if len(found) == 1:
            return found[0]
        if len(found) > 1:
            listed = ", ".join(header[i] for i in found)
            raise InputError(f"{table.path}: more than one {axis} column ({listed}); choose one with {axis}=NAME")
    raise InputError(
        f"{table.path}, line {table.header_line}: no {axis} column among {', '.join(header)}; "
        f"name it {axis} or {'longitude' if axis == 'x' else 'latitude'}, or choose one with {axis}=NAME"
    )


def named_column(table: CsvTable, header: Sequence[str], name: str, what: str) -> int:
    """The column of this name. Raises InputError where there is none, or more than one."""
    for same in (str.strip, lambda text: text.strip().lower()):
        found = [i for i, column in enumerate(header) if same(column) == same(name)]
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(f"{table.path}: more than one column is named '{name}'; rename one")
    raise InputError(f"{table.path}: no column '{name}' for {what}; there is: {', '.join(filter(None, header))}")


def value_column(table: CsvTable, header: Sequence[str], taken: Sequence[int], named: str | None) -> int:
    """The column of the value: the one named, or the only other one of numbers. `taken` hold something else."""
    if named is not None:
        column = named_column(table, header, named, "the value")
        if column in taken:
            raise InputError(f"{table.path}: column '{named}' is a position; choose another with value=NAME")
        return column
    numeric = [i for i in range(len(header)) if i not in taken and header[i].strip() and _is_numeric(table, i)]
    likely = [i for i in numeric if not set(words(header[i])[:1]) & _NO_VALUES]
    if len(likely) == 1:
        return likely[0]
    if len(likely) > 1:
        listed = ", ".join(header[i] for i in likely)
        raise InputError(f"{table.path}: more than one column of numbers ({listed}); choose one with value=NAME")
    others = [i for i in range(len(header)) if i not in taken and not set(words(header[i])[:1]) & _NO_VALUES]
    if len(others) == 1:
        return others[0]  # its first cell that is no number is told by its line
    raise InputError(f"{table.path}: no column of numbers besides the positions; a value a line is needed")


def _is_numeric(table: CsvTable, column: int) -> bool:
    """Whether the column has a number and nothing else but missing values."""
    cells = [row[column] for row in table.rows]
    present = [cell for cell in cells if not missing(cell)]
    return bool(present) and all(reading(table, cell) is not None for cell in present)
