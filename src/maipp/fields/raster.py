"""A measured field on a grid: bilinear in the scenario's domain, with the way back to the file's units."""

import math
from collections.abc import Sequence
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from maipp.errors import InputError
from maipp.fields.raster_data import RasterData
from maipp.fields.raster_io import load_raster
from maipp.geo import WGS84, GeoReference, ground_scale, read_crs

__all__ = ["Raster", "RasterData", "load_raster", "read_field"]


class Raster(eqx.Module):
    """A gridded ground-truth field: a callable from domain points (n, 2) to values (n,)."""

    values: Float[Array, "rows cols"]  # on the scenario's scale, 0..1 for the default limits
    x: Float[Array, " cols"]  # column positions, domain units, ascending from 0 to width
    y: Float[Array, " rows"]  # row positions, domain units, ascending from 0 to height
    reference: GeoReference = eqx.field(static=True)

    @classmethod
    def from_data(
        cls,
        data: RasterData,
        *,
        low: float | None = None,
        high: float | None = None,
        invert: bool = False,
    ) -> "Raster":
        """The field of `data` in the scenario's units.

        Positions: the longest side becomes 1, and the proportions are those on the ground at the file's middle where
        its reference system is known, else those of its coordinates.
        Values: `low` -> 0 and `high` -> 1, linearly and without clipping; they default to the smallest and
        largest value. `invert` swaps the two, so that the lowest value is the most interesting.
        Raises InputError for limits that are not usable, for degrees that are none, and for grid lines that
        the working precision cannot tell apart.
        """
        low = float(data.values.min() if low is None else low)
        high = float(data.values.max() if high is None else high)
        # The difference is tested, not only the order: it is what everything is divided by.
        if not (low < high and math.isfinite(high - low)):
            raise InputError(
                f"{data.source}: low={low:g} and high={high:g} span no finite range; low must be below high"
                + (" (use invert to make the lowest value 1)" if low > high else "")
            )
        size = (float(data.x[-1] - data.x[0]), float(data.y[-1] - data.y[0]))
        domain, metres_per_unit = _domain(data, size)
        there = GeoReference(
            origin=(float(data.x[0]), float(data.y[0])),
            size=size,
            domain=domain,
            value_at_zero=high if invert else low,
            value_at_one=low if invert else high,
            x_name=data.x_name or "x",
            y_name=data.y_name or "y",
            value_name=data.value_name or "value",
            plane=data.crs,
            metres_per_unit=metres_per_unit,
        )
        x, y = (jnp.asarray((axis - there.origin[i]) / size[i] * domain[i]) for i, axis in enumerate((data.x, data.y)))
        with np.errstate(over="ignore"):  # told below, in words
            values = jnp.asarray(there.to_domain_values(data.values))
        for name, axis, file_axis in ((there.x_name, x, data.x), (there.y_name, y, data.y)):
            merged = np.flatnonzero(np.diff(np.asarray(axis)) <= 0)
            if len(merged):
                a, b = file_axis[merged[0]], file_axis[merged[0] + 1]
                raise InputError(
                    f"{data.source}: {name}={a:.17g} and {b:.17g} are too close for {axis.dtype}; "
                    "drop one or set JAX_ENABLE_X64=1"
                )
        if not np.isfinite(np.asarray(values)).all():
            raise InputError(f"{data.source}: low={low:g} and high={high:g} are so close that the values overflow")
        return cls(values=values, x=x, y=y, reference=there)

    @property
    def domain(self) -> tuple[float, float]:
        """Width and height of the domain [0,width] x [0,height], domain units."""
        return self.reference.domain

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Field values at domain positions (n, 2): bilinear, exact at samples, the border's value outside."""
        column, right = _locate(self.x, points[:, 0])
        row, upper = _locate(self.y, points[:, 1])
        # Weighted sums, not v0 + t (v1 - v0), which misses the far end of a cell by a rounding error.
        lower_edge = self.values[row, column] * (1 - right) + self.values[row, column + 1] * right
        upper_edge = self.values[row + 1, column] * (1 - right) + self.values[row + 1, column + 1] * right
        return lower_edge * (1 - upper) + upper_edge * upper


def read_field(
    path: str | Path,
    *,
    value: str | None = None,
    low: float | None = None,
    high: float | None = None,
    invert: bool = False,
    crs: str | None = None,
    corners: Sequence[float] | None = None,
) -> Raster:
    """The ground truth in a file, for every command alike.

    `value` names the array, column, band or variable; `low` and `high` become 0 and 1, or the other way round with
    `invert`; `crs` says what the coordinates are, in place of what the file says; `corners` places a file without any
    (x of the first and last column, y of the first and last row). Raises InputError for what is no such field.
    """
    own = None if crs is None else read_crs(crs, "crs")
    return Raster.from_data(load_raster(path, value=value, extent=corners, crs=own), low=low, high=high, invert=invert)


def _locate(axis: Float[Array, " k"], position: Float[Array, " n"]) -> tuple[Int[Array, " n"], Float[Array, " n"]]:
    """The cell of each position along an ascending axis, and how far through that cell it lies (0..1)."""
    cell = jnp.clip(jnp.searchsorted(axis, position, side="right") - 1, 0, axis.shape[0] - 2)
    inside = jnp.clip(position, axis[0], axis[-1])
    return cell, (inside - axis[cell]) / (axis[cell + 1] - axis[cell])


def _domain(data: RasterData, size: tuple[float, float]) -> tuple[tuple[float, float], float | None]:
    """Width and height of the domain, and the true metres of a domain unit where they are known."""
    if data.crs == WGS84 and (data.y[0] < -90 or data.y[-1] > 90 or size[0] > 360):
        raise InputError(
            f"{data.source}: its coordinates are said to be degrees, but x spans {size[0]:g} and y is {data.y[0]:g}.."
            f"{data.y[-1]:g}; say what they are with crs, or none for a plain plane"
        )
    scale = ground_scale(data.crs, (data.x[0] + size[0] / 2, data.y[0] + size[1] / 2))
    width, height = size if scale is None else (size[0] * scale[0], size[1] * scale[1])
    longest = max(width, height)
    return (width / longest, height / longest), None if scale is None else longest
