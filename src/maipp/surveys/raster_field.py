"""A gridded map in the user's coordinates and unit, as a ground truth in the survey's domain."""

from collections.abc import Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import shapely
from scipy.interpolate import RegularGridInterpolator

from maipp.errors import InputError
from maipp.fields.raster import Raster, load_raster
from maipp.geo import WGS84, Crs, check_degrees, transform, unwrap
from maipp.surveys.raster_area import placed
from maipp.surveys.standardise import PreparedSurvey
from maipp.surveys.systems import file_system

_POINTS = 256  # along the longest side of the domain; finer maps are read at these points
_LEAST_COVERED = 0.95  # share of the free area that the map must cover


def raster_field(
    prepared: PreparedSurvey,
    path: Path,
    value: str | None = None,
    crs: Crs | None = None,
    at: Mapping[str, int] | None = None,
) -> Raster:
    """The map resampled to the domain, its values standardised; where the map has no value its nearest one stands.

    `crs` is of its coordinates, in place of what the file says, `at` the entry along further dimensions;
    a file that says nothing is in the mission's system.
    Raises `InputError` for a map that cannot be read, or that does not cover the area.
    """
    data, frame = placed(load_raster(path, value=value, gaps="nearest", crs=crs, at=at)), prepared.frame
    own = file_system(data.crs, prepared.crs, str(path))
    width, height = frame.domain
    x = np.linspace(0.0, width, max(int(_POINTS * width), 2))
    y = np.linspace(0.0, height, max(int(_POINTS * height), 2))
    domain = np.stack(np.meshgrid(x, y), axis=-1)
    user = frame.to_user(domain)
    if own.located:
        user = transform(user, WGS84, own, str(path))
    if own == WGS84:
        check_degrees(np.array([[data.x[0], data.y[0]], [data.x[-1], data.y[-1]]]), str(path))
        user = unwrap(user, float(data.x[0] + data.x[-1]) / 2)
    low, high = np.array([data.x[0], data.y[0]]), np.array([data.x[-1], data.y[-1]])
    # Half a cell beyond: values of a map stand for their cells.
    half = (high - low) / (np.array([len(data.x), len(data.y)]) - 1) / 2
    covered = np.asarray(np.all((user >= low - half) & (user <= high + half), axis=-1))
    place = np.clip(user, low, high)
    covered &= data.known(place.reshape(-1, 2)).reshape(covered.shape)
    metres = frame.domain_to_plane(domain)
    inside = np.asarray(shapely.intersects_xy(prepared.region, metres[..., 0], metres[..., 1]))
    share = float(covered[inside].mean()) if inside.any() else float(covered.mean())
    if share < _LEAST_COVERED:
        raise InputError(
            f"{path}: covers {share:.0%} of the area (x {low[0]:.6g} to {high[0]:.6g}, y {low[1]:.6g} to "
            f"{high[1]:.6g}); give a raster of all of it"
        )
    read = RegularGridInterpolator((data.y, data.x), data.values)
    values = frame.to_domain_values(read(place[..., ::-1]))
    return Raster(jnp.asarray(values), jnp.asarray(x), jnp.asarray(y), frame)
