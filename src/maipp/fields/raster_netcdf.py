"""Gridded fields in NetCDF files, read with xarray (the extra `maipp[geo]`)."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from maipp.errors import InputError
from maipp.fields.raster_data import X_NAMES, Y_NAMES, RasterData, choose, gaps_in
from maipp.fields.raster_geotiff import MOST_CELLS, first_line
from maipp.fields.raster_placed import refuse_extent, without_coordinates
from maipp.geo import WGS84, Crs, read_crs
from maipp.geo.crs import load_pyproj

# CF conventions, sections 4.1, 4.2 and 5: what tells an axis where its name does not.
_STANDARD = {"x": ("longitude", "projection_x_coordinate"), "y": ("latitude", "projection_y_coordinate")}
_NAMES = {"x": X_NAMES, "y": Y_NAMES}
_LENGTHS = {"m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "km": 1000.0}
_DEGREES = {"x": ("degrees_east", "degree_east", "degrees_e"), "y": ("degrees_north", "degree_north", "degrees_n")}


def read_netcdf(
    path: Path, value: str | None, extent: Sequence[float] | None, at: Mapping[str, int], fill: bool, own: Crs | None
) -> RasterData:
    """One variable of a NetCDF file as a grid; dimensions of length 1 are dropped, `at` chooses along longer ones.

    Longitudes beyond 180 degrees become negative ones where the grid lies there, or goes around the Earth. `own` stands
    in place of the file's reference system. Raises InputError where xarray is missing, for curvilinear grids, for
    dimensions left to choose, and for damaged files.
    """
    try:
        import xarray
    except ImportError:
        raise InputError(f"{path}: NetCDF needs xarray and h5netcdf; pip install 'maipp[geo]'") from None
    with _quiet():
        try:
            # Times are only counted here, and some have units that do not decode.
            with xarray.open_dataset(path, decode_times=False, decode_timedelta=False, decode_coords="all") as file:
                return _read(path, file, value, extent, at, fill, own)
        except InputError:
            raise
        except ImportError:  # xarray is there, what reads NetCDF 4 for it is not
            told = "NetCDF 4 needs h5netcdf and h5py; pip install 'maipp[geo]'"
        except Exception as error:  # whatever xarray's readers raise on a file that is none or is damaged
            told = f"not a NetCDF file, or damaged ({first_line(error)})"
    raise InputError(f"{path}: {told}")


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the tracebacks that readers print when they close a file that they could not open."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        yield
    finally:
        sys.unraisablehook = hook


def _read(
    path: Path,
    file: Any,
    value: str | None,
    extent: Sequence[float] | None,
    at: Mapping[str, int],
    fill: bool,
    own: Crs | None,
) -> RasterData:
    candidates = [str(name) for name, v in file.data_vars.items() if v.ndim >= 2 and v.dtype.kind in "biuf"]
    chosen = choose(candidates, value, f"{path}: ", "variable of two or more dimensions")
    variable = _flat(path, file[chosen], chosen, at)
    if variable.size > MOST_CELLS:
        raise InputError(f"{path}: {' x '.join(map(str, variable.shape))} cells are too many; cut it to the area")
    axes = {axis: next((d for d in variable.dims if _is_axis(file, str(d), axis)), None) for axis in "xy"}
    if axes["x"] is None and axes["y"] is None:
        meshes = [str(n) for n, c in file.variables.items() if c.ndim == 2 and str(n).lower() in X_NAMES + Y_NAMES]
        if meshes:
            raise InputError(
                f"{path}: '{chosen}' lies on a curvilinear grid (coordinates {', '.join(meshes)} have two dimensions); "
                "resample it to a regular one"
            )
        return without_coordinates(path, np.asarray(variable.values), extent, fill, value_name=chosen)
    if axes["x"] is None or axes["y"] is None or axes["x"] == axes["y"]:
        raise InputError(
            f"{path}: of the dimensions of '{chosen}' ({', '.join(map(str, variable.dims))}) it is not clear which are "
            "x and y; name them so, or lon and lat"
        )
    refuse_extent(path, extent)
    values = np.array(variable.transpose(axes["y"], axes["x"]).values)
    x, y = (np.array(file[axes[axis]].values, np.float64) for axis in "xy")
    geographic = all(_is_degrees(file, str(axes[axis]), axis) for axis in "xy")
    if geographic:
        x, values = _west_negative(x, values)
    missing = gaps_in(values) if fill else None
    unit = _unit(file, axes)
    crs = own or _crs(path, file, variable) or (WGS84 if geographic else Crs(metres=unit))
    if unit is not None and crs.metres is not None and unit != crs.metres:  # kilometres of a system that has metres
        x, y = x * (unit / crs.metres), y * (unit / crs.metres)
    return RasterData(values, x, y, str(path), str(axes["x"]), str(axes["y"]), chosen, crs, missing)


def _flat(path: Path, variable: Any, name: str, at: Mapping[str, int]) -> Any:
    """The variable with two dimensions left: those that `at` names are chosen along, those of length 1 dropped."""
    for dimension, index in at.items():
        if dimension not in variable.dims:
            raise InputError(
                f"{path}: '{name}' has no dimension '{dimension}'; there is: {', '.join(map(str, variable.dims))}"
            )
        length = variable.sizes[dimension]
        if not -length <= index < length:
            raise InputError(f"{path}: {dimension}={index} is not there; give 0 to {length - 1}")
        variable = variable.isel({dimension: index})
    while variable.ndim > 2:
        short = next((d for d in variable.dims if variable.sizes[d] == 1), None)
        if short is None:
            # Those in front are the ones to choose from, in the order of the conventions (T, Z, Y, X).
            first, last = str(variable.dims[0]), variable.sizes[variable.dims[0]] - 1
            sizes = ", ".join(f"{d}: {variable.sizes[d]}" for d in variable.dims)
            raise InputError(
                f"{path}: '{name}' has {variable.ndim} dimensions ({sizes}); choose an entry with "
                f"at {{{first}: 0}} (0 to {last})"
            )
        variable = variable.isel({short: 0})
    return variable


def _is_axis(file: Any, dimension: str, axis: str) -> bool:
    """Whether a dimension has a coordinate that is this axis, by its name or by its attributes."""
    if dimension not in file.variables or file[dimension].ndim != 1:
        return False
    attributes = file[dimension].attrs
    return (
        dimension.lower() in _NAMES[axis]
        or str(attributes.get("standard_name", "")) in _STANDARD[axis]
        or str(attributes.get("axis", "")).lower() == axis
        or _is_degrees(file, dimension, axis)
    )


def _is_degrees(file: Any, dimension: str, axis: str) -> bool:
    attributes = file[dimension].attrs
    return (
        str(attributes.get("units", "")).lower() in _DEGREES[axis]
        or str(attributes.get("standard_name", "")) == _STANDARD[axis][0]
        or dimension.lower() in _NAMES[axis][1:3]
    )


def _west_negative(x: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Longitudes of 180 to 360 as -180 to 0, the columns in order, where the grid is not torn apart by that."""
    around = len(x) > 1 and abs(x[-1] - x[0]) + abs(x[1] - x[0]) > 359
    if not x.size or x.max() <= 180 or not (x.min() >= 180 or around):
        return x, values
    x = np.where(x > 180, x - 360, x)
    x, first = np.unique(x, return_index=True)  # a grid around the Earth may give its first column again
    return x, values[:, first]


def _crs(path: Path, file: Any, variable: Any) -> Crs | None:
    """The coordinate reference system that the variable's grid mapping describes."""
    name = variable.encoding.get("grid_mapping") or variable.attrs.get("grid_mapping")
    if not isinstance(name, str) or name not in file.variables:
        return None
    attributes = dict(file[name].attrs)
    wkt = attributes.get("crs_wkt") or attributes.get("spatial_ref")
    if wkt:
        return read_crs(str(wkt), str(path))
    pyproj = load_pyproj(f"{path}: the grid mapping '{name}'")
    try:
        return read_crs(pyproj.CRS.from_cf(attributes).to_wkt(), str(path))
    except (pyproj.exceptions.CRSError, KeyError):
        return None


def _unit(file: Any, axes: Mapping[str, Any]) -> float | None:
    """Metres in a unit of the coordinates, where their attributes tell."""
    units = {_LENGTHS.get(str(file[axis].attrs.get("units", "")).lower()) for axis in axes.values()}
    return units.pop() if len(units) == 1 else None
