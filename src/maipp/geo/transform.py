"""Positions from one coordinate reference system to another, and how long a unit is on the ground."""

import math
from functools import lru_cache
from typing import Any

import numpy as np

from maipp.errors import InputError
from maipp.geo.crs import WGS84, Crs, load_pyproj
from maipp.typing import Float

HostPoints = Float[np.ndarray, "*n 2"]

# The WGS84 ellipsoid (NGA.STND.0036): equatorial radius in metres, and the first eccentricity squared.
_RADIUS, _ECCENTRICITY2 = 6_378_137.0, 6.694379990141316e-3
_SAME = 1e-4  # a projection whose scales differ by less is meant to have one
_STEP = 50.0  # metres: half the length that a unit is measured over, short enough to be straight


def transform(points: HostPoints, source: Crs, target: Crs, where: str = "coordinates") -> HostPoints:
    """The positions in another system; longitudes in [-180, 180). Order x, y or longitude, latitude on both sides.

    Other datums are led over by the best way that PROJ has without further files. Raises `InputError`, beginning with
    `where`, for a position that the other system has no place for, for a plane of no known place, and without pyproj.
    """
    points = np.array(points, np.float64)
    if source == target:
        return points
    if not (source.located and target.located):
        raise InputError(f"{where}: it is not known where on Earth they are ({source} to {target}); give their crs")
    flat = points.reshape(-1, 2)
    try:
        x, y = _transformer(source, target).transform(flat[:, 0], flat[:, 1])
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    moved = np.stack([np.asarray(x, np.float64), np.asarray(y, np.float64)], axis=-1)
    lost = np.flatnonzero(~np.isfinite(moved).all(axis=1))
    if len(lost):
        a, b = flat[lost[0]].tolist()
        raise InputError(f"{where}: ({a:.10g}, {b:.10g}) is no place in {source}; is that what they are in?")
    return wrap(moved.reshape(points.shape)) if target.geographic else moved.reshape(points.shape)


def wrap(points: HostPoints) -> HostPoints:
    """The same (longitude, latitude) positions with longitudes in [-180, 180)."""
    points = np.array(points, np.float64)
    points[..., 0] = (points[..., 0] + 180.0) % 360.0 - 180.0
    return points


def unwrap(points: HostPoints, reference: float) -> HostPoints:
    """The (longitude, latitude) positions with longitudes within 180 degrees of the reference."""
    points = np.array(points, np.float64)
    points[..., 0] += 360.0 * np.round((reference - points[..., 0]) / 360.0)
    return points


def check_degrees(points: Float[np.ndarray, "n 2"], where: str) -> None:
    """Raise `InputError` for positions that cannot be (longitude, latitude) in degrees, with the likely reason."""
    longitude, latitude = points[:, 0], points[:, 1]
    bad = np.flatnonzero((np.abs(latitude) > 90) | (longitude < -180) | (longitude > 360))
    if not len(bad):
        return
    x, y = points[bad[0]].tolist()
    if abs(x) <= 90 and abs(y) <= 360 and (np.abs(longitude) <= 90).all():
        hint = "positions are [longitude, latitude]: are they swapped?"
    else:
        hint = "give degrees as [longitude, latitude], or say what they are with crs (metres: true for a plain plane)"
    raise InputError(f"{where}: ({x:.10g}, {y:.10g}) is no longitude and latitude; {hint}")


def ground_scale(crs: Crs, place: tuple[float, float]) -> tuple[float, float] | None:
    """True metres of a unit of x and of a unit of y at a place in the system; None where that is not known.

    On the ellipsoid, not on the map: a metre of EPSG:3857 at 53 degrees of latitude is 0.6 m.
    """
    if not crs.located:
        return None if crs.metres is None else (crs.metres, crs.metres)
    if crs == WGS84:  # known without pyproj: the radii of curvature
        latitude = math.radians(place[1])
        flat = 1 - _ECCENTRICITY2 * math.sin(latitude) ** 2
        across, along = _RADIUS / math.sqrt(flat), _RADIUS * (1 - _ECCENTRICITY2) / flat**1.5
        return math.radians(across * math.cos(latitude)), math.radians(along)
    step = _STEP / (111_000.0 if crs.metres is None else crs.metres)
    ends = np.array(place) + step * np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
    west, east, south, north = transform(ends, crs, WGS84).tolist()
    geodesic = load_pyproj(str(crs)).Geod(ellps="WGS84")
    across, along = (geodesic.inv(*a, *b)[2] / (2 * step) for a, b in ((west, east), (south, north)))
    if math.isclose(across, along, rel_tol=_SAME):
        across = along = (across + along) / 2
    return across, along


@lru_cache(maxsize=32)
def _transformer(source: Crs, target: Crs) -> Any:
    pyproj = load_pyproj(f"converting {source} to {target}")
    # Where no way between two datums is known PROJ would take them for one, which is off by some 100 m. For a datum
    # without a name, as weather models have it, there is nothing better; for others it is an error.
    try:
        systems = [pyproj.CRS.from_user_input(crs.name) for crs in (source, target)]
        return pyproj.Transformer.from_crs(*systems, always_xy=True, allow_ballpark=any(map(_nameless, systems)))
    except pyproj.exceptions.ProjError:
        raise InputError(
            f"no way from {source} to {target} is known here; convert it first (gdalwarp or ogr2ogr, -t_srs EPSG:4326)"
        ) from None


def _nameless(crs: Any) -> bool:
    """Whether the system is on a datum that is only an ellipsoid."""
    datum = crs.geodetic_crs.datum if crs.geodetic_crs is not None else None
    return datum is None or datum.name.lower().startswith("unknown")
