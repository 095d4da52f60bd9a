"""Gridded fields in NetCDF files, read with xarray (the extra `maipp[geo]`)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from maipp.fields.netcdf_apart import read_apart
from maipp.fields.netcdf_grid import NetcdfGrid, read_grid
from maipp.fields.raster_data import RasterData, gaps_in
from maipp.fields.raster_placed import refuse_extent, without_coordinates
from maipp.geo import WGS84, Crs, read_crs
from maipp.geo.crs import load_pyproj

_CLASSIC = (b"CDF\x01", b"CDF\x02")  # NetCDF 3, which SciPy reads in Python; all else may be read by C code


def read_netcdf(
    path: Path, value: str | None, extent: Sequence[float] | None, at: Mapping[str, int], fill: bool, own: Crs | None
) -> RasterData:
    """One variable of a NetCDF file as a grid; dimensions of length 1 are dropped, `at` chooses along longer ones.

    Longitudes beyond 180 degrees become negative ones where the grid lies there, or goes around the Earth. `own` stands
    in place of the file's reference system. Raises InputError where xarray is missing, for curvilinear grids, for
    dimensions left to choose, and for damaged files.
    """
    with path.open("rb") as file:
        classic = file.read(4) in _CLASSIC
    grid = read_grid(path, value, at, engine="scipy") if classic else read_apart(path, value, at)
    if grid.x is None or grid.y is None:
        return without_coordinates(path, grid.values, extent, fill, value_name=grid.name)
    refuse_extent(path, extent)
    values, x, y = grid.values, grid.x, grid.y
    if grid.degrees:
        x, values = _west_negative(x, values)
    missing = gaps_in(values) if fill else None
    crs = own or _crs(path, grid) or (WGS84 if grid.degrees else Crs(metres=grid.metres))
    # Kilometres of a system that has metres.
    if grid.metres is not None and crs.metres is not None and grid.metres != crs.metres:
        x, y = x * (grid.metres / crs.metres), y * (grid.metres / crs.metres)
    return RasterData(values, x, y, str(path), grid.x_name, grid.y_name, grid.name, crs, missing)


def _west_negative(x: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Longitudes of 180 to 360 as -180 to 0, the columns in order, where the grid is not torn apart by that."""
    around = len(x) > 1 and abs(x[-1] - x[0]) + abs(x[1] - x[0]) > 359
    if not x.size or x.max() <= 180 or not (x.min() >= 180 or around):
        return x, values
    x = np.where(x > 180, x - 360, x)
    x, first = np.unique(x, return_index=True)  # a grid around the Earth may give its first column again
    return x, values[:, first]


def _crs(path: Path, grid: NetcdfGrid) -> Crs | None:
    """The coordinate reference system that the variable's grid mapping describes."""
    if grid.mapping is None:
        return None
    wkt = grid.attributes.get("crs_wkt") or grid.attributes.get("spatial_ref")
    if wkt:
        return read_crs(str(wkt), str(path))
    pyproj = load_pyproj(f"{path}: the grid mapping '{grid.mapping}'")
    try:
        return read_crs(pyproj.CRS.from_cf(grid.attributes).to_wkt(), str(path))
    except (pyproj.exceptions.CRSError, KeyError):
        return None
