"""One variable cut out of a NetCDF file with xarray, and what the file says of its axes.

Neither this nor what it imports needs JAX, for which a process that only reads a file would wait.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from maipp.errors import InputError, first_line
from maipp.fields.raster_terms import MOST_CELLS, X_NAMES, Y_NAMES, choose

# CF conventions, sections 4.1, 4.2 and 5: what tells an axis where its name does not.
_STANDARD = {"x": ("longitude", "projection_x_coordinate"), "y": ("latitude", "projection_y_coordinate")}
_NAMES = {"x": X_NAMES, "y": Y_NAMES}
_LENGTHS = {"m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "km": 1000.0}
_DEGREES = {"x": ("degrees_east", "degree_east", "degrees_e"), "y": ("degrees_north", "degree_north", "degrees_n")}


@dataclass(frozen=True, eq=False)
class NetcdfGrid:
    """A variable with two dimensions left, as the file has it; without coordinates, `x` and `y` are None."""

    name: str
    values: np.ndarray  # (rows, cols) numbers
    x: np.ndarray | None = None  # (cols,) float64, coordinate of each column
    y: np.ndarray | None = None  # (rows,) float64, coordinate of each row
    x_name: str | None = None
    y_name: str | None = None
    degrees: bool = False  # whether the axes are longitude and latitude
    metres: float | None = None  # in a unit of the coordinates, where their attributes tell
    mapping: str | None = None  # the variable that describes the coordinate reference system
    attributes: dict[str, Any] = field(default_factory=dict)  # of that variable: texts, numbers and lists of them


def read_grid(path: Path, value: str | None, at: Mapping[str, int], engine: str | None = None) -> NetcdfGrid:
    """The variable `value`, or the only one; dimensions of length 1 are dropped, `at` chooses along longer ones.

    `engine` is xarray's reader; without one, xarray looks for one that fits. Raises InputError where xarray is missing,
    for curvilinear grids, for dimensions left to choose, and for damaged files.
    """
    try:
        import xarray
    except ImportError:
        raise InputError(f"{path}: NetCDF needs xarray and h5netcdf; pip install 'maipp[geo]'") from None
    with _quiet():
        try:
            # Times are only counted here, and some have units that do not decode.
            with xarray.open_dataset(
                path, engine=engine, decode_times=False, decode_timedelta=False, decode_coords="all"
            ) as file:
                return _cut(path, file, value, at)
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


def _cut(path: Path, file: Any, value: str | None, at: Mapping[str, int]) -> NetcdfGrid:
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
        return NetcdfGrid(chosen, np.array(variable.values))
    if axes["x"] is None or axes["y"] is None or axes["x"] == axes["y"]:
        raise InputError(
            f"{path}: of the dimensions of '{chosen}' ({', '.join(map(str, variable.dims))}) it is not clear which are "
            "x and y; name them so, or lon and lat"
        )
    values = np.array(variable.transpose(axes["y"], axes["x"]).values)
    x, y = (np.array(file[axes[axis]].values, np.float64) for axis in "xy")
    degrees = all(_is_degrees(file, str(axes[axis]), axis) for axis in "xy")
    mapping = variable.encoding.get("grid_mapping") or variable.attrs.get("grid_mapping")
    if not isinstance(mapping, str) or mapping not in file.variables:
        mapping = None
    attributes = {} if mapping is None else {str(name): _plain(a) for name, a in file[mapping].attrs.items()}
    names = str(axes["x"]), str(axes["y"])
    return NetcdfGrid(chosen, values, x, y, *names, degrees, _unit(file, axes), mapping, attributes)


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


def _unit(file: Any, axes: Mapping[str, Any]) -> float | None:
    """Metres in a unit of the coordinates, where their attributes tell."""
    units = {_LENGTHS.get(str(file[axis].attrs.get("units", "")).lower()) for axis in axes.values()}
    return units.pop() if len(units) == 1 else None


def _plain(attribute: Any) -> Any:
    """A text, a number, or a list of them, as JSON has them."""
    if isinstance(attribute, np.ndarray | np.generic):
        attribute = attribute.tolist()
    if isinstance(attribute, list):
        return [_plain(part) for part in attribute]
    return attribute if isinstance(attribute, str | int | float) else str(attribute)
