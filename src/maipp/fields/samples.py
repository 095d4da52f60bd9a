"""Old samples of a field, read from CSV as people have it: a position and a value a line."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from maipp.errors import InputError
from maipp.fields.csv_table import CsvTable, missing, read_table
from maipp.fields.raster_data import X_NAMES, Y_NAMES

_X = (*X_NAMES, "long", "lng", "east")
_Y = (*Y_NAMES, "north")
_DEGREES = ("lon", "longitude", "long", "lng", "lat", "latitude")
# What may follow such a name: `lon_deg`, `x (m)`, `Latitude [decimal degrees]`.
_UNITS = {
    "deg",
    "degree",
    "degrees",
    "dd",
    "decimal",
    "m",
    "metre",
    "metres",
    "meter",
    "meters",
    "wgs84",
    "utm",
    "north",
}
_UNITS |= {"east", "n", "e"}

# Columns that number or date the lines: never taken for the value unless named.
_NO_VALUES = {"id", "fid", "no", "nr", "number", "index", "point", "station", "sample", "line"}
_NO_VALUES |= {"time", "date", "datetime", "timestamp", "t", "year", "month", "day", "hour", "minute", "second", "utc"}


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples in their file's own units; every number is finite."""

    x: Float[np.ndarray, " n"]  # easting or longitude
    y: Float[np.ndarray, " n"]  # northing or latitude
    value: Float[np.ndarray, " n"]
    names: tuple[str, str, str]  # of the columns that hold x, y and the value
    source: str  # the file
    dropped: int  # lines left out because a position or the value is missing

    @property
    def points(self) -> Float[np.ndarray, "n 2"]:
        """Positions, order x, y."""
        return np.stack([self.x, self.y], axis=1)

    @property
    def geographic(self) -> bool:
        """Whether the columns' names say degrees."""
        return all(_words(name)[:1] in [[degrees] for degrees in _DEGREES] for name in self.names[:2])


def load_samples(path: str | Path, *, value: str | None = None, x: str | None = None, y: str | None = None) -> Samples:
    """The samples in a CSV file; `value`, `x` and `y` name its columns where the names do not tell.

    Cells are separated by commas, semicolons, tabs or blanks; next to a semicolon or a tab numbers may have a decimal
    comma. Position columns go by their customary names (lon, longitude, x, easting; lat, latitude, y, northing), the
    value is the only other column of numbers, lines without one of the three are dropped and counted. Without a header
    three columns are x, y and value. Raises InputError naming file and line.
    """
    table = read_table(Path(path))
    header = table.header
    if header is None:
        if len(table.rows[0]) != 3 or value or x or y:
            raise InputError(
                f"{path}: has no header; name the columns in its first line, such as lon,lat,value "
                f"(line {table.lines[0]} has {len(table.rows[0])} columns)"
            )
        header = ["x", "y", "value"]
    ix, iy = _position(table, header, _X, x, "x", "longitude"), _position(table, header, _Y, y, "y", "latitude")
    if ix == iy:
        raise InputError(f"{path}: column '{header[ix]}' cannot be both x and y; give two columns")
    table = _without_units_line(table, (ix, iy))
    columns = (ix, iy, _value(table, header, (ix, iy), value))
    names = (header[columns[0]], header[columns[1]], header[columns[2]])
    numbers = table.numbers(columns)
    kept = np.asarray(np.isfinite(numbers).all(axis=1))
    if not kept.any():
        raise InputError(f"{path}: no line has a position and a value ({len(kept)} lines read)")
    found = numbers[kept]
    samples = Samples(found[:, 0], found[:, 1], found[:, 2], names, str(path), int((~kept).sum()))
    _check_degrees(samples, [line for line, keep in zip(table.lines, kept, strict=True) if keep])
    return samples


def _position(
    table: CsvTable, header: Sequence[str], customary: Sequence[str], named: str | None, axis: str, other: str
) -> int:
    """The column of an axis: the one named, or the one with a customary name."""
    if named is not None:
        return _named(table, header, named, axis)
    exact = [i for i, name in enumerate(header) if name.strip().lower() in customary]
    loose = [i for i, name in enumerate(header) if _words(name)[:1] and _words(name)[0] in customary
             and set(_words(name)[1:]) <= _UNITS]  # fmt: skip
    for found in (exact, loose):
        if len(found) == 1:
            return found[0]
        if len(found) > 1:
            listed = ", ".join(header[i] for i in found)
            raise InputError(f"{table.path}: more than one {axis} column ({listed}); choose one with {axis}=NAME")
    raise InputError(
        f"{table.path}, line {table.header_line}: no {axis} column among {', '.join(header)}; "
        f"name it {axis} or {other}, or choose one with {axis}=NAME"
    )


def _named(table: CsvTable, header: Sequence[str], name: str, what: str) -> int:
    for same in (str.strip, lambda text: text.strip().lower()):
        found = [i for i, column in enumerate(header) if same(column) == same(name)]
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(f"{table.path}: more than one column is named '{name}'; rename one")
    raise InputError(f"{table.path}: no column '{name}' for {what}; there is: {', '.join(filter(None, header))}")


def _value(table: CsvTable, header: Sequence[str], taken: tuple[int, int], named: str | None) -> int:
    """The column of the value: the one named, or the only other one of numbers."""
    if named is not None:
        column = _named(table, header, named, "the value")
        if column in taken:
            raise InputError(f"{table.path}: column '{named}' is a position; choose another with value=NAME")
        return column
    numeric = [i for i in range(len(header)) if i not in taken and header[i].strip() and _is_numeric(table, i)]
    likely = [i for i in numeric if not set(_words(header[i])[:1]) & _NO_VALUES]
    if len(likely) == 1:
        return likely[0]
    if len(likely) > 1:
        listed = ", ".join(header[i] for i in likely)
        raise InputError(f"{table.path}: more than one column of numbers ({listed}); choose one with value=NAME")
    others = [i for i in range(len(header)) if i not in taken and not set(_words(header[i])[:1]) & _NO_VALUES]
    if len(others) == 1:
        return others[0]  # its first cell that is no number is told by its line
    raise InputError(f"{table.path}: no column of numbers besides the positions; a value a line is needed")


def _is_numeric(table: CsvTable, column: int) -> bool:
    """Whether the column has a number and nothing else but missing values."""
    cells = [row[column] for row in table.rows]
    present = [cell for cell in cells if not missing(cell)]
    return bool(present) and all(table.number(cell) is not None for cell in present)


def _without_units_line(table: CsvTable, position: tuple[int, int]) -> CsvTable:
    """The table without a line of units below its header, as some data servers write it."""
    if table.header is None or len(table.rows) < 2:
        return table
    cells = [table.rows[0][i] for i in position]
    if any(table.number(cell) is not None or missing(cell) for cell in cells):
        return table
    if any(table.number(cell) is not None for cell in table.rows[0]):
        return table
    below = [table.rows[1][i] for i in position]
    if any(table.number(cell) is None for cell in below):
        return table
    return table._replace(rows=table.rows[1:], lines=table.lines[1:])


def _check_degrees(samples: Samples, lines: Sequence[int]) -> None:
    if not samples.geographic:
        return
    wrong = np.flatnonzero((np.abs(samples.y) > 90) | (samples.x < -180) | (samples.x > 360))
    if len(wrong):
        i = int(wrong[0])
        raise InputError(
            f"{samples.source}, line {lines[i]}: {samples.names[0]}={samples.x[i]:g}, {samples.names[1]}="
            f"{samples.y[i]:g} is no place on Earth; name the columns x and y if they are metres"
        )


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z0-9]+", name.lower())
