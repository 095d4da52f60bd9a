"""A measured field on a grid: bilinear in the scenario's domain, with the way back to the file's units."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from maipp.errors import InputError
from maipp.fields.raster_data import RasterData
from maipp.fields.raster_io import load_raster

__all__ = ["Mapping", "Raster", "RasterData", "load_raster"]

HostPoints = Float[np.ndarray | Array, "*batch 2"]
HostValues = Float[np.ndarray | Array, "..."] | float


@dataclass(frozen=True)
class Mapping:
    """The affine map between a file's units and the scenario's: [0,width] x [0,height] and values 0..1.

    Plain floats and hashable, so that it can be static under jit. Every method computes in float64 on the
    host and returns a numpy array of the shape given.
    """

    origin: tuple[float, float]  # file coordinates (x, y) of the domain's corner (0, 0)
    size: tuple[float, float]  # extent of the file in x and y, file units
    domain: tuple[float, float]  # (width, height) of the domain, domain units
    value_at_zero: float  # file value that becomes 0
    value_at_one: float  # file value that becomes 1; below value_at_zero when inverted
    x_name: str | None = None
    y_name: str | None = None
    value_name: str | None = None

    def to_domain_points(self, points: HostPoints) -> Float[np.ndarray, "*batch 2"]:
        """Domain positions of file coordinates (..., 2), order x, y."""
        return np.asarray((_host(points) - self.origin) / self.size * self.domain)

    def to_file_points(self, points: HostPoints) -> Float[np.ndarray, "*batch 2"]:
        """File coordinates of domain positions (..., 2), order x, y."""
        return np.asarray(_host(points) / self.domain * self.size + self.origin)

    def to_domain_values(self, values: HostValues) -> Float[np.ndarray, "..."]:
        """Values on the scenario's scale (0..1 for the default limits) of values in file units."""
        return np.asarray((_host(values) - self.value_at_zero) / (self.value_at_one - self.value_at_zero))

    def to_file_values(self, values: HostValues) -> Float[np.ndarray, "..."]:
        """Values in file units of values on the scenario's scale."""
        return np.asarray(_host(values) * (self.value_at_one - self.value_at_zero) + self.value_at_zero)

    def to_file_std(self, std: HostValues) -> Float[np.ndarray, "..."]:
        """Standard deviations in file units: scaled by the slope's magnitude, not shifted."""
        return np.asarray(_host(std) * abs(self.value_at_one - self.value_at_zero))


class Raster(eqx.Module):
    """A gridded ground-truth field: a callable from domain points (n, 2) to values (n,)."""

    values: Float[Array, "rows cols"]  # on the scenario's scale, 0..1 for the default limits
    x: Float[Array, " cols"]  # column positions, domain units, ascending from 0 to width
    y: Float[Array, " rows"]  # row positions, domain units, ascending from 0 to height
    mapping: Mapping = eqx.field(static=True)

    @classmethod
    def from_data(
        cls,
        data: RasterData,
        *,
        extent: Sequence[float] | None = None,
        low: float | None = None,
        high: float | None = None,
        invert: bool = False,
        geographic: bool = False,
    ) -> "Raster":
        """The field of `data` in the scenario's units.

        Positions: the longest side becomes 1 and the aspect ratio is kept; `geographic` says the coordinates
        are degrees and shrinks x by cos(middle latitude) so that the ratio is metric. `extent` = (width,
        height) of a fixed domain stretches the file over it instead.
        Values: `low` -> 0 and `high` -> 1, linearly and without clipping; they default to the smallest and
        largest value. `invert` swaps the two, so that the lowest value is the most interesting.
        Raises InputError for limits or extents that are not usable and for grid lines that the working
        precision cannot tell apart.
        """
        size = (float(data.x[-1] - data.x[0]), float(data.y[-1] - data.y[0]))
        low = float(data.values.min() if low is None else low)
        high = float(data.values.max() if high is None else high)
        # The difference is tested, not only the order: it is what everything is divided by.
        if not (low < high and math.isfinite(high - low)):
            raise InputError(
                f"{data.source}: low={low:g} and high={high:g} span no finite range; low must be below high"
                + (" (use invert to make the lowest value 1)" if low > high else "")
            )
        mapping = Mapping(
            origin=(float(data.x[0]), float(data.y[0])),
            size=size,
            domain=_domain(data, size, extent, geographic),
            value_at_zero=high if invert else low,
            value_at_one=low if invert else high,
            x_name=data.x_name,
            y_name=data.y_name,
            value_name=data.value_name,
        )
        x = jnp.asarray((data.x - mapping.origin[0]) / size[0] * mapping.domain[0])
        y = jnp.asarray((data.y - mapping.origin[1]) / size[1] * mapping.domain[1])
        with np.errstate(over="ignore"):  # told below, in words
            values = jnp.asarray(mapping.to_domain_values(data.values))
        for name, axis, file_axis in ((data.x_name or "x", x, data.x), (data.y_name or "y", y, data.y)):
            merged = np.flatnonzero(np.diff(np.asarray(axis)) <= 0)
            if len(merged):
                a, b = file_axis[merged[0]], file_axis[merged[0] + 1]
                raise InputError(
                    f"{data.source}: {name}={a:.17g} and {b:.17g} are too close for {axis.dtype}; "
                    "drop one or set JAX_ENABLE_X64=1"
                )
        if not np.isfinite(np.asarray(values)).all():
            raise InputError(f"{data.source}: low={low:g} and high={high:g} are so close that the values overflow")
        return cls(values=values, x=x, y=y, mapping=mapping)

    @property
    def domain(self) -> tuple[float, float]:
        """Width and height of the domain [0,width] x [0,height], domain units."""
        return self.mapping.domain

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Field values at domain positions (n, 2): bilinear, exact at samples, the border's value outside."""
        column, right = _locate(self.x, points[:, 0])
        row, upper = _locate(self.y, points[:, 1])
        # Weighted sums, not v0 + t (v1 - v0), which misses the far end of a cell by a rounding error.
        lower_edge = self.values[row, column] * (1 - right) + self.values[row, column + 1] * right
        upper_edge = self.values[row + 1, column] * (1 - right) + self.values[row + 1, column + 1] * right
        return lower_edge * (1 - upper) + upper_edge * upper


def _locate(axis: Float[Array, " k"], position: Float[Array, " n"]) -> tuple[Int[Array, " n"], Float[Array, " n"]]:
    """The cell of each position along an ascending axis, and how far through that cell it lies (0..1)."""
    cell = jnp.clip(jnp.searchsorted(axis, position, side="right") - 1, 0, axis.shape[0] - 2)
    inside = jnp.clip(position, axis[0], axis[-1])
    return cell, (inside - axis[cell]) / (axis[cell + 1] - axis[cell])


def _domain(
    data: RasterData, size: tuple[float, float], extent: Sequence[float] | None, geographic: bool
) -> tuple[float, float]:
    if extent is not None:
        if geographic:
            raise InputError(f"{data.source}: give extent or geographic, not both; extent fixes the aspect ratio")
        if len(extent) != 2 or not all(math.isfinite(side) and side > 0 for side in extent):
            raise InputError(
                f"{data.source}: extent must be the domain's (width, height), both above 0; got "
                + ",".join(f"{side:g}" for side in extent)
            )
        return float(extent[0]), float(extent[1])
    width, height = size
    if geographic:
        south, north = float(data.y[0]), float(data.y[-1])
        if south < -90 or north > 90 or width > 360:
            raise InputError(
                f"{data.source}: geographic needs degrees, but x spans {width:g}, y is {south:g}..{north:g}"
            )
        width *= math.cos(math.radians((south + north) / 2))
    longest = max(width, height)
    return width / longest, height / longest


def _host(array: HostValues) -> Float[np.ndarray, "..."]:
    return np.asarray(array, dtype=np.float64)
