"""Old samples of a field, read from CSV as people have it: a position and a value a line."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from maipp.errors import InputError
from maipp.fields.angles import angle, hemisphere, packed
from maipp.fields.csv_table import CsvTable, missing, read_table
from maipp.fields.raster_data import stray_value
from maipp.fields.readings import readings, told_lines
from maipp.fields.sample_columns import DEGREES, position_column, value_column, words


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples in their file's own units; every number is finite."""

    x: Float[np.ndarray, " n"]  # easting or longitude
    y: Float[np.ndarray, " n"]  # northing or latitude
    value: Float[np.ndarray, " n"]
    names: tuple[str, str, str]  # of the columns that hold x, y and the value
    source: str  # the file
    lines: Int[np.ndarray, " n"]  # of the file, counting from 1
    dropped: int = 0  # lines left out because a position or the value is missing
    notes: tuple[str, ...] = ()  # what was taken as something, for people to read
    in_degrees: bool = False  # whether positions are written as degrees, such as 13° 19' E

    @property
    def points(self) -> Float[np.ndarray, "n 2"]:
        """Positions, order x, y."""
        return np.stack([self.x, self.y], axis=1)

    @property
    def geographic(self) -> bool:
        """Whether the positions or the columns' names say degrees."""
        return self.in_degrees or all(words(name)[:1] in [[degrees] for degrees in DEGREES] for name in self.names[:2])


def load_samples(path: str | Path, *, value: str | None = None, x: str | None = None, y: str | None = None) -> Samples:
    """The samples in a CSV file; `value`, `x` and `y` name its columns where the names do not tell.

    Cells are separated by commas, semicolons, tabs or blanks; next to a semicolon or a tab numbers may have a decimal
    comma. Position columns go by their customary names (lon, longitude, x, easting; lat, latitude, y, northing) and may
    hold degrees, minutes and hemispheres; the value is the only other column of numbers. Lines without one of the three
    are dropped and counted, those that hold -9999 or the like for a value are dropped and named. Without a header three
    columns are x, y and value. Raises InputError naming file and line.
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
    ix, iy = position_column(table, header, x, "x"), position_column(table, header, y, "y")
    if ix == iy:
        raise InputError(f"{path}: column '{header[ix]}' cannot be both x and y; give two columns")
    table = _without_units_line(table, (ix, iy))
    (xs, x_degrees), (ys, y_degrees) = positions(table, ix, "x"), positions(table, iy, "y")
    iv = value_column(table, header, (ix, iy), value)
    values, notes = readings(table, iv)
    numbers = np.stack([xs, ys, values], axis=1)
    kept = np.asarray(np.isfinite(numbers).all(axis=1))
    if not kept.any():
        raise InputError(f"{path}: no line has a position and a value ({len(kept)} lines read)")
    lines, found = np.array(table.lines)[kept], numbers[kept]
    stray = strays(found[:, 2])
    if stray.any():
        held = ", ".join(f"{each:g}" for each in np.unique(found[stray, 2]))
        notes.append(f"{told_lines(lines[stray].tolist())} with {held}, which looks like no value; left out")
        lines, found = lines[~stray], found[~stray]
    names = (header[ix], header[iy], header[iv])
    columns = found[:, 0], found[:, 1], found[:, 2]
    dropped = int((~kept).sum())
    samples = Samples(*columns, names, str(path), lines, dropped, tuple(notes), x_degrees or y_degrees)
    _check_degrees(samples)
    return samples


def positions(table: CsvTable, column: int, axis: str) -> tuple[Float[np.ndarray, " n"], bool]:
    """The coordinates in a column, NaN where one is missing, and whether they are written as degrees.

    A column beside it that holds hemispheres turns them. Raises InputError naming line and column.
    """
    turned = _hemispheres(table, column, axis)
    found, written = np.empty(len(table.rows)), turned is not None
    for row, cells in enumerate(table.rows):
        cell = cells[column]
        number = np.nan if missing(cell) else table.number(cell)
        if number is None:
            number = angle(cell, axis)
            written |= number is not None
        found[row] = table.numbers([column], rows=[row])[0, 0] if number is None else number
    if turned is not None:
        # As receivers transmit them; no longitude has so many degrees.
        with_minutes = (found[np.isfinite(found)] > (180 if axis == "x" else 90)).any()
        found = turned * (np.vectorize(packed)(found) if with_minutes else found)
    return found, written


def strays(values: Float[np.ndarray, " n"]) -> np.ndarray:
    """Which of the values are what files hold where they have none, such as -9999 (`stray_value`)."""
    found = np.zeros(len(values), bool)
    while (stray := stray_value(values, found)) is not None:
        found |= values == stray
    return found


def _hemispheres(table: CsvTable, column: int, axis: str) -> Float[np.ndarray, " n"] | None:
    """1 or -1 for each row, where the next column holds hemispheres and nothing else; None where not."""
    if column + 1 >= len(table.rows[0]):
        return None
    turned = [hemisphere(row[column + 1], axis) for row in table.rows]
    return None if None in turned else np.array(turned, float)


def _without_units_line(table: CsvTable, position: tuple[int, int]) -> CsvTable:
    """The table without a line of units below its header, as some data servers write it."""
    if table.header is None or len(table.rows) < 2:
        return table
    first, second = ([row[i] for i in position] for row in table.rows[:2])
    if any(_is_place(table, cell) or missing(cell) for cell in first):
        return table
    if any(table.number(cell) is not None for cell in table.rows[0]):
        return table
    if not all(_is_place(table, cell) for cell in second):
        return table
    return table._replace(rows=table.rows[1:], lines=table.lines[1:])


def _is_place(table: CsvTable, cell: str) -> bool:
    return table.number(cell) is not None or any(angle(cell, axis) is not None for axis in "xy")


def _check_degrees(samples: Samples) -> None:
    if not samples.geographic:
        return
    wrong: Sequence[int] = np.flatnonzero((np.abs(samples.y) > 90) | (samples.x < -180) | (samples.x > 360)).tolist()
    if wrong:
        i = wrong[0]
        raise InputError(
            f"{samples.source}, line {samples.lines[i]}: {samples.names[0]}={samples.x[i]:g}, {samples.names[1]}="
            f"{samples.y[i]:g} is no place on Earth; name the columns x and y if they are metres"
        )
