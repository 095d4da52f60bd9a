"""A checked rectangular grid of values in its file's units."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt

from maipp.errors import InputError
from maipp.geo import PLANE, Crs

_NINES = [10.0**digits - 1 for digits in range(3, 9)]  # 999, 9999, ...
_STRAY = [32767.0, -32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0]
_STRAY += [-99.0, *(sign * nines for nines in _NINES for sign in (1, -1))]


@dataclass(frozen=True, eq=False)
class RasterData:
    """A rectangular grid of values in its file's own units, both coordinates ascending.

    Construction converts to float64, flips descending coordinates (the values with them) and checks all that
    the planner relies on. Raises InputError, starting with `source`, for fewer than 2 x 2 values, shapes that
    do not fit, values not finite or all equal, and coordinates that are not strictly monotonic.

    A map of a lake has no values on land: where `missing` is given, those cells get the value of the nearest cell that
    has one, so that interpolation near the shore is not spoilt, and `known` tells where the map has values.
    """

    # Shapes are checked below, not annotated: a person whose file has others must be told so in words.
    values: np.ndarray  # (rows, cols) float64, file units of the quantity
    x: np.ndarray  # (cols,) float64, coordinate of each column, file units, ascending
    y: np.ndarray  # (rows,) float64, coordinate of each row, file units, ascending
    source: str = "raster"  # where it came from, for error messages
    x_name: str | None = None
    y_name: str | None = None
    value_name: str | None = None
    crs: Crs = PLANE  # what the coordinates are; a plane of no known place where nobody says
    missing: np.ndarray | None = None  # (rows, cols) bool, True where the file has no value; None: none is missing
    placed: bool = True  # whether the file has coordinates, or was given any; else they count cells
    notes: tuple[str, ...] = ()  # what was taken as something, for people to read

    def __post_init__(self) -> None:
        values = numeric(self.values, self.source, self.value_name or "value")
        check_size(values, self.source)
        x = numeric(self.x, self.source, self.x_name or "x")
        y = numeric(self.y, self.source, self.y_name or "y")
        if (y.shape, x.shape) != (values.shape[:1], values.shape[1:]):
            raise InputError(
                f"{self.source}: the values are {values.shape[0]} rows x {values.shape[1]} columns, "
                f"but coordinate '{self.y_name or 'y'}' has shape {y.shape} "
                f"and '{self.x_name or 'x'}' {x.shape}; one y per row and one x per column are needed"
            )
        _check_monotonic(x, self.x_name or "x", self.source)
        _check_monotonic(y, self.y_name or "y", self.source)
        missing = self.missing
        if missing is not None:
            values = filled(values, missing, x, y, self.source)
        # Before any flip, so that the cell named is the cell in the file.
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            row, col = bad[0]
            raise InputError(
                f"{self.source}: value {values[row, col]} at row {row}, column {col} (counting from 0; "
                f"x={x[col]:.10g}, y={y[row]:.10g}), {len(bad)} such in all; fill the gaps before loading"
            )
        if values.min() == values.max():
            raise InputError(f"{self.source}: every value is {values.flat[0]:g}; a constant field cannot be rescaled")
        if x[0] > x[-1]:
            x, values, missing = x[::-1], values[:, ::-1], None if missing is None else missing[:, ::-1]
        if y[0] > y[-1]:
            y, values, missing = y[::-1], values[::-1], None if missing is None else missing[::-1]
        for field, array in (("values", values), ("x", x), ("y", y), ("missing", missing)):
            object.__setattr__(self, field, None if array is None else np.ascontiguousarray(array))

    def known(self, points: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Whether the map has a value at file coordinates (x, y): within its box, and the nearest cell not missing."""
        column, row = (_nearest(axis, points[:, i]) for i, axis in enumerate((self.x, self.y)))
        low, high = np.array([self.x[0], self.y[0]]), np.array([self.x[-1], self.y[-1]])
        inside = np.asarray(((points >= low) & (points <= high)).all(axis=1))
        return inside if self.missing is None else inside & ~self.missing[row, column]


def gaps_in(values: np.ndarray) -> Bool[np.ndarray, "rows cols"] | None:
    """Where a grid has no value: masked or not finite; None where every cell has one."""
    if np.asarray(values).ndim != 2 or np.asarray(values).dtype.kind not in "biuf":
        return None  # told in words when the raster is made
    missing = np.ma.getmaskarray(values) | ~np.isfinite(np.ma.getdata(values))
    return missing if missing.any() else None


def stray_value(values: Float[np.ndarray, "..."], missing: np.ndarray | None = None) -> float | None:
    """A value that files hold where they have none, such as -9999, and that is far from all others; None without any.

    Far: farther from the nearest other value than these are from each other.
    """
    present = np.unique(values if missing is None else values[~missing])
    stands = np.isin(present, _STRAY) | (np.abs(present) > 1e19)
    rest = present[~stands]
    if len(rest) >= 2:
        for stray in present[stands].tolist():
            if max(rest[0] - stray, stray - rest[-1]) > rest[-1] - rest[0]:
                return stray
    return None


def is_stray(value: float) -> bool:
    """Whether a number is one that files and sensors say where they have no value, such as -9999."""
    return value in _STRAY or abs(value) > 1e19


def filled(
    values: Float[np.ndarray, "rows cols"], missing: np.ndarray, x: np.ndarray, y: np.ndarray, source: str
) -> Float[np.ndarray, "rows cols"]:
    """The values, those of missing cells taken from the nearest cell that has one (by the axes' mean spacing).

    Raises InputError where no cell has a value.
    """
    if missing.shape != values.shape or missing.dtype != bool:
        raise InputError(f"{source}: missing must tell for each of {values.shape} cells, it is {missing.shape}")
    if missing.all():
        raise InputError(f"{source}: not one cell has a value")
    spacing = [abs(float(axis[-1] - axis[0])) / (len(axis) - 1) for axis in (y, x)]
    nearest = distance_transform_edt(missing, sampling=spacing, return_distances=False, return_indices=True)
    return values[tuple(np.asarray(nearest))]


def _nearest(axis: Float[np.ndarray, " k"], position: Float[np.ndarray, " n"]) -> np.ndarray:
    """Index of the nearest entry of an ascending axis."""
    return np.searchsorted((axis[1:] + axis[:-1]) / 2, position)


def check_size(values: np.ndarray, source: str) -> None:
    """Raise InputError for fewer than 2 x 2 values."""
    if values.ndim != 2 or min(values.shape) < 2:
        shape = " x ".join(map(str, values.shape)) or "a single number"
        raise InputError(f"{source}: a raster needs at least 2 x 2 values, this one is {shape}")


def numeric(array: np.ndarray, source: str, name: str) -> Float[np.ndarray, "..."]:
    """The array as float64; InputError if it holds anything but real numbers."""
    array = np.asarray(array)
    check_real(array, source, name)
    return array.astype(np.float64)


def check_real(array: np.ndarray, source: str, name: str) -> None:
    """Raise InputError if the array holds anything but real numbers."""
    if array.dtype.kind not in "biuf":
        raise InputError(f"{source}: '{name}' holds {array.dtype}, not real numbers")


def _check_monotonic(axis: Float[np.ndarray, " n"], name: str, source: str) -> None:
    if not np.isfinite(axis).all():
        i = int(np.flatnonzero(~np.isfinite(axis))[0])
        raise InputError(f"{source}: coordinate '{name}' is {axis[i]} at entry {i} (counting from 0)")
    step = np.sign(axis[1] - axis[0]) * np.diff(axis)
    if not (step > 0).all():
        i = int(np.flatnonzero(step <= 0)[0]) + 1
        raise InputError(
            f"{source}: coordinate '{name}' must rise or fall strictly, but entry {i} (counting from 0) is "
            f"{axis[i]:.10g} after {axis[i - 1]:.10g}"
        )
