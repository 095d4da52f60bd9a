"""Grids of files without coordinates: placed by an extent, or in units of cells."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from maipp.errors import InputError
from maipp.fields.raster_data import RasterData, check_real, check_size, gaps_in


def without_coordinates(
    path: Path, values: np.ndarray, extent: Sequence[float] | None, fill: bool, value_name: str | None = None
) -> RasterData:
    """The grid over `extent` = (x0, x1, y0, y1), or in cells; `fill` fills cells without a value from the nearest."""
    if values.ndim != 2:
        raise InputError(f"{path}: a raster is a 2-D array (rows, columns), this one has {values.ndim} dimensions")
    rows, cols = values.shape
    # Before the coordinates: what takes no room, no columns or empty words, may have any number of rows.
    check_real(values, str(path), value_name or "value")
    check_size(values, str(path))
    if extent is None:
        x, y = np.arange(cols, dtype=float), np.arange(rows, dtype=float)
    else:
        if len(extent) != 4 or not np.isfinite(extent).all():
            raise InputError(f"{path}: extent must be four finite numbers x0,x1,y0,y1, not {list(extent)}")
        x0, x1, y0, y1 = map(float, extent)
        if x0 == x1 or y0 == y1:
            raise InputError(f"{path}: extent {x0:g},{x1:g},{y0:g},{y1:g} has no area; give x0,x1,y0,y1")
        x, y = np.linspace(x0, x1, cols), np.linspace(y0, y1, rows)
    missing = gaps_in(values) if fill else None
    return RasterData(
        np.ma.getdata(values), x, y, str(path), value_name=value_name, missing=missing, placed=extent is not None
    )


def refuse_extent(path: Path, extent: Sequence[float] | None) -> None:
    """Raise InputError where an extent is given for a file that has coordinates."""
    if extent is not None:
        raise InputError(f"{path}: the file has its own coordinates; leave out extent")
