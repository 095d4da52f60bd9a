"""Gridded fields as people bring them: .npz, .npy and .csv files read to one checked grid."""

import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from maipp.errors import InputError
from maipp.fields.raster_csv import csv_columns, grid_from_rows, parse_csv
from maipp.fields.raster_data import X_NAMES, Y_NAMES, RasterData, choose, numeric

# What NumPy, zipfile and zlib raise on a file that is not what its suffix says, or is cut short. NumPy's reader of
# headers lets through what Python's tokenizer and parser say of them, and sizes that no memory holds.
BROKEN = (
    ValueError,
    TypeError,
    SyntaxError,
    EOFError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
    tokenize.TokenError,
    OverflowError,
    MemoryError,
)


def load_raster(path: str | Path, *, value: str | None = None, extent: Sequence[float] | None = None) -> RasterData:
    """The grid stored in a .npz, .npy or .csv file, with its coordinates in the file's own units.

    `value` names the array of an .npz, or the column of a CSV with a header, where the choice is not obvious.
    `extent` = (x of the first column, x of the last, y of the first row, y of the last) places a file without
    coordinates; a picture whose first row is the top has y0 > y1. Without it the units are pixel indices.
    A CSV is x,y,value rows if it has a header, or three columns and at least four lines; otherwise a matrix.
    Raises InputError (one line naming the file and the problem) for anything that is not a full, finite grid.
    """
    path = Path(path)
    readers = {".npz": _read_npz, ".npy": _read_npy, ".csv": _read_csv}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown suffix '{path.suffix}'; a raster is a .npz, .npy or .csv file")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path}: the file is empty")
        return reader(path, value, extent)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _read_npz(path: Path, value: str | None, extent: Sequence[float] | None) -> RasterData:
    arrays: dict[str, np.ndarray] = {}
    pickled: dict[str, Exception] = {}
    try:
        archive = np.load(path, allow_pickle=False)
    except BROKEN as error:
        raise InputError(f"{path}: not an .npz archive; write one with numpy.savez") from error
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise InputError(f"{path}: holds a single array, not an .npz archive; rename it to .npy")
    with archive:
        for key in archive.files:
            try:
                arrays[key] = np.asarray(archive[key])
            except BROKEN as error:
                if "pickle" not in str(error):
                    _unreadable(path, f"array '{key}'", error)
                # Pickled extras (names, attributes) are never opened and need not stop the rest from loading.
                pickled[key] = error

    def is_coordinate(key: str) -> bool:
        return key.lower() in X_NAMES + Y_NAMES

    grids = [k for k, a in arrays.items() if a.ndim == 2 and a.dtype.kind in "biuf" and not is_coordinate(k)]
    for key, error in pickled.items():
        if key == value or not grids:
            _unreadable(path, f"array '{key}'", error)
    chosen = choose(grids, value, f"{path}: ", "numeric 2-D array")
    grid = arrays[chosen]
    x_key, y_key = (
        next((k for name in names for k in arrays if k.lower() == name), None) for names in (X_NAMES, Y_NAMES)
    )
    if x_key is None and y_key is None:
        return _without_coordinates(path, grid, extent, value_name=chosen)
    if x_key is None or y_key is None:
        have, lack = (y_key, X_NAMES) if x_key is None else (x_key, Y_NAMES)
        raise InputError(f"{path}: has coordinate '{have}' but not the other; add one named {' or '.join(lack)}")
    _refuse_extent(path, extent)
    x, y = (numeric(arrays[key], str(path), key) for key in (x_key, y_key))
    # Coordinates saved as a mesh: the same row (column) repeated.
    if grid.size and x.shape == grid.shape and (x == x[:1]).all():
        x = x[0]
    if grid.size and y.shape == grid.shape and (y == y[:, :1]).all():
        y = y[:, 0]
    return RasterData(grid, x, y, str(path), x_key, y_key, chosen)


def _read_npy(path: Path, value: str | None, extent: Sequence[float] | None) -> RasterData:
    _refuse_value(path, value)
    try:
        array = np.load(path, allow_pickle=False)
    except BROKEN as error:
        _unreadable(path, "the array", error)
    if not isinstance(array, np.ndarray):
        array.close()
        raise InputError(f"{path}: is an archive of several arrays; rename it to .npz")
    return _without_coordinates(path, array, extent)


def _read_csv(path: Path, value: str | None, extent: Sequence[float] | None) -> RasterData:
    header, table, lines = parse_csv(path)
    if header is None and not (table.shape[1] == 3 and len(table) >= 4):
        _refuse_value(path, value)
        return _without_coordinates(path, table, extent)
    _refuse_extent(path, extent)
    if header is None:
        _refuse_value(path, value)
        columns, names = (0, 1, 2), (None, None, None)
    else:
        columns = csv_columns(path, header, value)
        names = tuple(header[i] for i in columns)
    return grid_from_rows(path, table[:, columns], lines, names)


def _without_coordinates(
    path: Path, values: np.ndarray, extent: Sequence[float] | None, value_name: str | None = None
) -> RasterData:
    if values.ndim != 2:
        raise InputError(f"{path}: a raster is a 2-D array (rows, columns), this one has {values.ndim} dimensions")
    rows, cols = values.shape
    if extent is None:
        x, y = np.arange(cols, dtype=float), np.arange(rows, dtype=float)
    else:
        if len(extent) != 4 or not np.isfinite(extent).all():
            raise InputError(f"{path}: extent must be four finite numbers x0,x1,y0,y1, not {list(extent)}")
        x0, x1, y0, y1 = map(float, extent)
        if x0 == x1 or y0 == y1:
            raise InputError(f"{path}: extent {x0:g},{x1:g},{y0:g},{y1:g} has no area; give x0,x1,y0,y1")
        x, y = np.linspace(x0, x1, cols), np.linspace(y0, y1, rows)
    return RasterData(values, x, y, str(path), value_name=value_name)


def _refuse_extent(path: Path, extent: Sequence[float] | None) -> None:
    if extent is not None:
        raise InputError(f"{path}: the file has its own coordinates; leave out extent")


def _refuse_value(path: Path, value: str | None) -> None:
    if value is not None:
        raise InputError(f"{path}: has no named arrays or columns; leave out value='{value}'")


def _unreadable(path: Path, what: str, error: Exception) -> NoReturn:
    if "pickle" in str(error):
        raise InputError(
            f"{path}: {what} holds pickled Python objects or is not NumPy data; save a plain array of numbers"
        ) from error
    raise InputError(f"{path}: {what} is damaged or cut short; save it again") from error
