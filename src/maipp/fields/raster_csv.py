"""Gridded fields in CSV text: x,y,value rows or a plain matrix."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from maipp.errors import InputError
from maipp.fields.raster_data import RasterData, gaps_in
from maipp.fields.raster_terms import X_NAMES, Y_NAMES, choose


def csv_columns(path: Path, header: list[str], value: str | None) -> tuple[int, int, int]:
    """Which columns hold x, y and the value, by name or, where neither axis is named, in that order."""
    lower = [name.lower() for name in header]
    ix, iy = (next((lower.index(n) for n in names if n in lower), None) for names in (X_NAMES, Y_NAMES))
    if ix is None and iy is None and len(header) == 3:
        ix, iy = 0, 1
    if ix is None or iy is None:
        raise InputError(
            f"{path}: the header names no x and y columns (it has {', '.join(header)}); "
            "write x,y,value columns, or a plain matrix without a header"
        )
    # A nameless column is a row index that some tables write first.
    candidates = [name for i, name in enumerate(header) if i not in (ix, iy) and name]
    chosen = choose(candidates, value, f"{path}: ", "value column")
    return ix, iy, next(i for i, name in enumerate(header) if name == chosen and i not in (ix, iy))


def grid_from_rows(
    path: Path,
    table: Float[np.ndarray, "n 3"],
    lines: list[int],
    names: tuple[str | None, str | None, str | None],
    fill: bool = False,
) -> RasterData:
    """The grid that x,y,value rows in any order fill; InputError where a cell is missing or given twice.

    `fill` takes values that are not finite for missing ones, and fills them from the nearest.
    """
    bad = np.argwhere(~np.isfinite(table[:, :2]))
    if len(bad):
        row, column = bad[0]
        raise InputError(f"{path}, line {lines[row]}: coordinate {'xy'[column]} is {table[row, column]}, not finite")
    hint = "" if names[0] else " (three columns are read as x,y,value; save a three-column matrix as .npy)"
    x, ix = _distinct(table[:, 0])
    y, iy = _distinct(table[:, 1])
    cell = iy * len(x) + ix
    order = np.argsort(cell, kind="stable")
    cell = cell[order]
    twice = np.flatnonzero(cell[1:] == cell[:-1])
    if len(twice):
        first, again = order[twice[0]], order[twice[0] + 1]
        raise InputError(
            f"{path}, line {lines[again]}: duplicate cell x={table[again, 0]:.10g}, "
            f"y={table[again, 1]:.10g}, already given on line {lines[first]}{hint}"
        )
    size = len(x) * len(y)
    if len(cell) < size:
        # Sorted and without duplicates, the first place where they fall out of step is the first gap.
        gaps = np.flatnonzero(cell != np.arange(len(cell)))
        row, col = divmod(int(gaps[0]) if len(gaps) else len(cell), len(x))
        raise InputError(
            f"{path}: not a full grid, {size - len(cell)} of {len(y)} x {len(x)} cells are missing; "
            f"the first is x={x[col]:.10g}, y={y[row]:.10g}{hint}"
        )
    values = table[order, 2].reshape(len(y), len(x))
    return RasterData(values, x, y, str(path), *names, missing=gaps_in(values) if fill else None)


def _distinct(coordinate: Float[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
    """The distinct coordinates, ascending, and the index of each entry among them."""
    unique, inverse = np.unique(coordinate, return_inverse=True)
    # Exported coordinates carry rounding in the last digits: that close, they are the same line of the grid.
    starts = np.concatenate([[True], np.diff(unique) > 1e-9 * (unique[-1] - unique[0])])
    return unique[starts], (np.cumsum(starts) - 1)[inverse]
