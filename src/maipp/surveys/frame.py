"""The three coordinate systems of a survey: the user's, local metres, and the scenario's domain units."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.typing import Float

HostPoints = Float[np.ndarray, "*n 2"]
HostValues = Float[np.ndarray, "..."] | float


@dataclass(frozen=True)
class Frame:
    """The maps between what the user writes and what is planned with.

    User coordinates are (longitude, latitude) in degrees of WGS84 where `geographic`, else metres (x east, y north).
    Local metres come from an azimuthal equidistant projection around the area's centre: lengths are right to 0.1 %
    within 500 km of it, and straight lines through the centre are geodesics. Domain units are local metres from the
    lower left corner of the area's bounding box, its longest side being 1. Standardised values have a prior mean of 0
    and a prior standard deviation of 1; where low values matter (`below`) their sign is turned, so that high ones do.

    Frozen and hashable. Every method computes in float64 on the host and returns an array of the shape given.
    """

    geographic: bool
    centre: tuple[float, float]  # (longitude, latitude) of the projection's centre, degrees; (0, 0) without one
    origin: tuple[float, float]  # local metres of the domain's corner (0, 0)
    size: tuple[float, float]  # width and height of the area's bounding box, local metres
    mean: float = 0.0  # prior mean, in the quantity's unit
    std: float = 1.0  # prior standard deviation, in the quantity's unit
    below: bool = False  # low values are those that matter
    quantity: str | None = None
    unit: str | None = None

    @property
    def metres_per_unit(self) -> float:
        """Metres in one domain unit."""
        return max(self.size)

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of the domain, domain units; the larger is 1."""
        return self.size[0] / self.metres_per_unit, self.size[1] / self.metres_per_unit

    @property
    def value_name(self) -> str:
        """The quantity with its unit, for headings."""
        name = self.quantity or "value"
        return f"{name} ({self.unit})" if self.unit else name

    def to_metres(self, points: HostPoints) -> HostPoints:
        """Local metres of user coordinates."""
        return project(self.centre, points) if self.geographic else np.array(points, np.float64)

    def from_metres(self, points: HostPoints) -> HostPoints:
        """User coordinates of local metres; longitudes in [-180, 180)."""
        return unproject(self.centre, points) if self.geographic else np.array(points, np.float64)

    def to_domain(self, points: HostPoints) -> HostPoints:
        """Domain positions of user coordinates."""
        return (self.to_metres(points) - self.origin) / self.metres_per_unit

    def to_user(self, points: HostPoints) -> HostPoints:
        """User coordinates of domain positions; longitudes in [-180, 180)."""
        return self.from_metres(np.asarray(points, np.float64) * self.metres_per_unit + self.origin)

    def to_domain_values(self, values: HostValues) -> Float[np.ndarray, "..."]:
        """Standardised values of values in the unit."""
        return np.asarray((np.asarray(values, np.float64) - self.mean) / self._signed_std)

    def to_user_values(self, values: HostValues) -> Float[np.ndarray, "..."]:
        """Values in the unit of standardised values."""
        return np.asarray(np.asarray(values, np.float64) * self._signed_std + self.mean)

    def to_user_std(self, std: HostValues) -> Float[np.ndarray, "..."]:
        """Standard deviations and errors in the unit: scaled, not shifted."""
        return np.asarray(np.asarray(std, np.float64) * self.std)

    @property
    def _signed_std(self) -> float:
        return -self.std if self.below else self.std

    @property
    def reference(self) -> GeoReference:
        """The same with the names of coordinates and values, for the record of a survey."""
        west, south = self.origin
        bounds = (west, south, west + self.size[0], south + self.size[1])
        there = GeoReference.of_area(bounds, self.centre if self.geographic else None)
        there = there.standardised(self.mean, self.std, below=self.below)
        return replace(there, value_name=self.value_name)


def project(centre: tuple[float, float], points: HostPoints) -> HostPoints:
    """Local metres (east, north of the centre) of (longitude, latitude) in degrees."""
    return _transform(centre, "FORWARD", points)


def unproject(centre: tuple[float, float], points: HostPoints) -> HostPoints:
    """(longitude, latitude) in degrees of local metres; longitudes in [-180, 180)."""
    return wrap(_transform(centre, "INVERSE", points))


def wrap(points: HostPoints) -> HostPoints:
    """The same (longitude, latitude) positions with longitudes in [-180, 180)."""
    points = np.array(points, np.float64)
    points[..., 0] = (points[..., 0] + 180.0) % 360.0 - 180.0
    return points


def _transform(centre: tuple[float, float], direction: Any, points: HostPoints) -> HostPoints:
    flat = np.asarray(points, np.float64).reshape(-1, 2)
    x, y = _projection(centre).transform(flat[:, 0], flat[:, 1], direction=direction)
    return np.stack([np.asarray(x), np.asarray(y)], axis=-1).reshape(np.shape(points))


@lru_cache(maxsize=8)
def _projection(centre: tuple[float, float]) -> Any:
    try:
        import pyproj
    except ImportError:
        raise InputError(
            "longitude and latitude need pyproj; install it with: pip install 'maipp[geo]' (or give metres)"
        ) from None
    longitude, latitude = centre
    local = f"+proj=aeqd +lat_0={latitude!r} +lon_0={longitude!r} +datum=WGS84 +units=m +no_defs"
    return pyproj.Transformer.from_crs("EPSG:4326", local, always_xy=True)
