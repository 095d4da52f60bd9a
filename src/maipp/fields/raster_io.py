"""Gridded fields as people bring them: NumPy, CSV, GeoTIFF and NetCDF files read to one checked grid."""

import dataclasses
import tokenize
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from maipp.errors import InputError, first_line
from maipp.extensions import READERS, extension, extensions
from maipp.fields.csv_table import read_table
from maipp.fields.raster_csv import csv_columns, grid_from_rows
from maipp.fields.raster_data import RasterData, gaps_in, numeric, stray_value
from maipp.fields.raster_geotiff import read_geotiff
from maipp.fields.raster_netcdf import read_netcdf
from maipp.fields.raster_placed import refuse_extent, without_coordinates
from maipp.fields.raster_terms import X_NAMES, Y_NAMES, choose
from maipp.geo import Crs

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


SUFFIXES = (".npz", ".npy", ".csv", ".tif", ".tiff", ".nc", ".nc4", ".cdf")


def load_raster(
    path: str | Path,
    *,
    value: str | None = None,
    extent: Sequence[float] | None = None,
    at: Mapping[str, int] | None = None,
    gaps: str = "refuse",
    crs: Crs | None = None,
) -> RasterData:
    """The grid stored in a .npz, .npy, .csv, GeoTIFF or NetCDF file, with its coordinates in the file's own units.

    `value` names the array of an .npz, the column of a CSV with a header, the band of a GeoTIFF (its name or number,
    counting from 1) or the variable of a NetCDF, where the choice is not obvious. `at` chooses the entry (counting from
    0) along further dimensions of a NetCDF variable, such as `{"time": 0}`.
    `extent` = (x of the first column, x of the last, y of the first row, y of the last) places a file without
    coordinates; a picture whose first row is the top has y0 > y1. Without it the units are pixel indices.
    A CSV is x,y,value rows if it has a header, or three columns and at least four lines; otherwise a matrix.
    `gaps="nearest"` fills cells without a value (masked, no-data, NaN) from the nearest that has one and tells which in
    `RasterData.missing`; "refuse" wants none. A value such as -9999, far from all others, counts as none, and is told.
    `crs` says what the coordinates are, in place of what the file says.
    GeoTIFF and NetCDF need the extra `maipp[geo]`.
    Raises InputError (one line naming the file and the problem) for anything that is not such a grid.
    """
    path = Path(path)
    if gaps not in ("refuse", "nearest"):
        raise InputError(f"gaps: {gaps!r} is no way to treat cells without a value; give refuse or nearest")
    suffix, fill = path.suffix.lower(), gaps == "nearest"
    reader = None if suffix in SUFFIXES else extension(READERS, suffix.lstrip("."), f"{path}: reader of {suffix} files")
    if suffix not in SUFFIXES and reader is None:
        *some, last = [*SUFFIXES, *(f".{name}" for name in extensions(READERS))]
        raise InputError(f"{path}: unknown suffix '{path.suffix}'; a raster is a {', '.join(some)} or {last} file")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if at and suffix not in (".nc", ".nc4", ".cdf"):
        raise InputError(f"{path}: only a NetCDF file has further dimensions; leave out at={dict(at)}")
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path}: the file is empty")
        if reader is not None:
            data = _read_by(reader.thing, path, value, extent)
        elif suffix in (".tif", ".tiff"):
            data = read_geotiff(path, value, extent, fill, crs)
        elif suffix in (".nc", ".nc4", ".cdf"):
            data = read_netcdf(path, value, extent, at or {}, fill, crs)
        else:
            data = {".npz": _read_npz, ".npy": _read_npy, ".csv": _read_csv}[suffix](path, value, extent, fill)
        data = _without_strays(data, fill)
        return data if crs is None else dataclasses.replace(data, crs=crs)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _read_by(reader: Any, path: Path, value: str | None, extent: Sequence[float] | None) -> RasterData:
    """The grid that another package's reader gives. Raises InputError where it fails, or gives something else."""
    for name, given in (("value", value), ("extent", extent)):
        if given is not None:
            raise InputError(f"{path}: {path.suffix} files are read by {reader.__module__}; leave out {name}={given}")
    try:
        data = reader(path)
    except InputError:
        raise
    except Exception as error:  # whatever another package raises
        told = f"{type(error).__name__}: {first_line(error)}"
        raise InputError(f"{path}: {reader.__module__} cannot read it: {told}") from error
    if not isinstance(data, RasterData):
        raise InputError(f"{path}: {reader.__module__} gave a {type(data).__name__}, where a RasterData is due")
    return data


def _without_strays(data: RasterData, fill: bool) -> RasterData:
    """The grid, cells that hold what stands for no value in it among the missing ones."""
    stray = stray_value(data.values, data.missing)
    if stray is None:
        return data
    cells = data.values == stray
    told = f"{data.source}: {int(cells.sum())} cells hold {stray:.10g}, which looks like no value"
    if not fill:
        raise InputError(f"{told}; fill the gaps before loading")
    missing = cells if data.missing is None else cells | data.missing
    return dataclasses.replace(data, missing=missing, notes=(*data.notes, f"{told}; taken as none"))


def _read_npz(path: Path, value: str | None, extent: Sequence[float] | None, fill: bool) -> RasterData:
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
        return without_coordinates(path, grid, extent, fill, value_name=chosen)
    if x_key is None or y_key is None:
        have, lack = (y_key, X_NAMES) if x_key is None else (x_key, Y_NAMES)
        raise InputError(f"{path}: has coordinate '{have}' but not the other; add one named {' or '.join(lack)}")
    refuse_extent(path, extent)
    x, y = (numeric(arrays[key], str(path), key) for key in (x_key, y_key))
    # Coordinates saved as a mesh: the same row (column) repeated.
    if grid.size and x.shape == grid.shape and (x == x[:1]).all():
        x = x[0]
    if grid.size and y.shape == grid.shape and (y == y[:, :1]).all():
        y = y[:, 0]
    missing = gaps_in(grid) if fill else None
    return RasterData(grid, x, y, str(path), x_key, y_key, chosen, missing=missing)


def _read_npy(path: Path, value: str | None, extent: Sequence[float] | None, fill: bool) -> RasterData:
    _refuse_value(path, value)
    try:
        array = np.load(path, allow_pickle=False)
    except BROKEN as error:
        _unreadable(path, "the array", error)
    if not isinstance(array, np.ndarray):
        array.close()
        raise InputError(f"{path}: is an archive of several arrays; rename it to .npz")
    return without_coordinates(path, array, extent, fill)


def _read_csv(path: Path, value: str | None, extent: Sequence[float] | None, fill: bool) -> RasterData:
    table = read_table(path)
    header, width = table.header, len(table.rows[0])
    if header is None and not (width == 3 and len(table.rows) >= 4):
        _refuse_value(path, value)
        return without_coordinates(path, table.numbers(range(width)), extent, fill)
    refuse_extent(path, extent)
    if header is None:
        _refuse_value(path, value)
        columns, names = (0, 1, 2), (None, None, None)
    else:
        columns = csv_columns(path, header, value)
        names = header[columns[0]], header[columns[1]], header[columns[2]]
    return grid_from_rows(path, table.numbers(columns), table.lines, names, fill)


def _refuse_value(path: Path, value: str | None) -> None:
    if value is not None:
        raise InputError(f"{path}: has no named arrays or columns; leave out value='{value}'")


def _unreadable(path: Path, what: str, error: Exception) -> NoReturn:
    if "pickle" in str(error):
        raise InputError(
            f"{path}: {what} holds pickled Python objects or is not NumPy data; save a plain array of numbers"
        ) from error
    raise InputError(f"{path}: {what} is damaged or cut short; save it again") from error
