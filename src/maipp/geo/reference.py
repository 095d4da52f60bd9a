"""One domain on Earth, in a plane or on paper: from what people write to what is planned with, and back."""

import math
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from maipp.geo.crs import METRES, PLANE, WGS84, Crs, local_crs
from maipp.geo.transform import transform

HostPoints = Float[np.ndarray | Array, "*n 2"]
HostValues = Float[np.ndarray | Array, "..."] | float
Pair = tuple[float, float]

_UNIT_BEHIND = re.compile(r"(?<=\S)\s+\(((?:[^()]|\([^()]*\))+)\)$")


@dataclass(frozen=True)
class GeoReference:
    """The maps between the user's coordinates and values and the scenario's.

    Positions go from the user's system to that of a plane (a projection; nothing where they are the same), and from
    there by an affine map to the domain [0, width] x [0, height]. Values are scaled and shifted. For a field's file the
    plane's coordinates are the file's own, and the domain has the proportions on the ground; a survey of a real place
    has local metres for its plane and WGS84 for its user.

    Frozen and hashable, so that it can be static under jit. Every method computes in float64 on the host and returns
    a NumPy array of the shape given.
    """

    origin: Pair  # plane coordinates (x, y) of the domain's corner (0, 0)
    size: Pair  # extent of the domain in x and y, plane units
    domain: Pair  # (width, height) of the domain, domain units
    value_at_zero: float = 0.0  # user's value that becomes 0: the smallest, or the prior mean
    value_at_one: float = 1.0  # user's value that becomes 1; below value_at_zero where low values matter
    x_name: str = "x"
    y_name: str = "y"
    value_name: str = "value"  # with the unit behind it, as in "depth (m)"
    plane: Crs = PLANE
    user: Crs | None = None  # of the coordinates that people write and read; None: the plane's
    metres_per_unit: float | None = None  # true metres in a domain unit; None where it is not known

    @classmethod
    def of_domain(cls, extent: Pair) -> "GeoReference":
        """The reference that changes nothing: domain units and normalised values."""
        return cls((0.0, 0.0), extent, extent)

    @classmethod
    def of_area(cls, bounds: tuple[float, float, float, float], centre: Pair | None = None) -> "GeoReference":
        """The domain of an area whose longest side becomes 1; values are not yet standardised.

        `bounds` are west, south, east and north of the area in metres: those of the local projection around `centre`
        (longitude, latitude), where the user's coordinates are degrees, or without one the user's own.
        """
        west, south, east, north = bounds
        size = east - west, north - south
        longest = max(size)
        plane, user = (METRES, None) if centre is None else (local_crs(centre), WGS84)
        names = ("x (m)", "y (m)") if centre is None else ("longitude (deg E)", "latitude (deg N)")
        domain = size[0] / longest, size[1] / longest
        return cls((west, south), size, domain, 0.0, 1.0, *names, plane=plane, user=user, metres_per_unit=longest)

    @property
    def crs(self) -> Crs:
        """The system of the coordinates that people write and read."""
        return self.user or self.plane

    @property
    def geographic(self) -> bool:
        """Whether the user's coordinates are longitude and latitude."""
        return self.crs.geographic

    @property
    def unit(self) -> str | None:
        """Unit of the values: what stands in brackets behind their name."""
        behind = _UNIT_BEHIND.search(self.value_name)
        return behind[1] if behind else None

    @property
    def quantity(self) -> str:
        """Name of the values without their unit."""
        return _UNIT_BEHIND.sub("", self.value_name)

    @property
    def inverted(self) -> bool:
        """Whether low values are the interesting ones."""
        return self.value_at_one < self.value_at_zero

    @property
    def mean(self) -> float:
        """What 0 is in the user's unit: the prior mean of a survey."""
        return self.value_at_zero

    @property
    def std(self) -> float:
        """What 1 is in the user's unit: the prior standard deviation of a survey."""
        return abs(self.value_at_one - self.value_at_zero)

    @property
    def scale(self) -> float:
        """Plane units in a domain unit along x; of a survey, whose plane has local metres, metres in any direction."""
        return self.size[0] / self.domain[0]

    @property
    def units_per_domain(self) -> Pair:
        """Plane units in a domain unit along x and y."""
        return self.size[0] / self.domain[0], self.size[1] / self.domain[1]

    @property
    def aspect(self) -> float:
        """Length of a plane unit of y over that of one of x, in the domain's proportions."""
        scale_x, scale_y = self.units_per_domain
        return scale_x / scale_y

    @property
    def length_scale(self) -> float | None:
        """Plane units in a domain unit along any path; None where x and y differ in it (degrees, stretched files)."""
        scale_x, scale_y = self.units_per_domain
        return scale_x if math.isclose(scale_x, scale_y, rel_tol=1e-9) else None

    def to_plane(self, points: HostPoints) -> Float[np.ndarray, "*n 2"]:
        """Plane coordinates of user coordinates, order x, y or longitude, latitude."""
        points = np.array(points, np.float64)
        return points if self.user is None else transform(points, self.user, self.plane)

    def from_plane(self, points: HostPoints) -> Float[np.ndarray, "*n 2"]:
        """User coordinates of plane coordinates."""
        points = np.array(points, np.float64)
        return points if self.user is None else transform(points, self.plane, self.user)

    def plane_to_domain(self, points: HostPoints) -> Float[np.ndarray, "*n 2"]:
        """Domain positions of plane coordinates."""
        return np.asarray((np.asarray(points, np.float64) - self.origin) / self.size * self.domain)

    def domain_to_plane(self, points: HostPoints) -> Float[np.ndarray, "*n 2"]:
        """Plane coordinates of domain positions."""
        return np.asarray(np.asarray(points, np.float64) / self.domain * self.size + self.origin)

    def to_domain(self, points: HostPoints) -> Float[np.ndarray, "*n 2"]:
        """Domain positions of user coordinates."""
        return self.plane_to_domain(self.to_plane(points))

    def to_user(self, points: HostPoints) -> Float[np.ndarray, "*n 2"]:
        """User coordinates of domain positions; projected longitudes in [-180, 180)."""
        return self.from_plane(self.domain_to_plane(points))

    def to_domain_values(self, values: HostValues) -> Float[np.ndarray, "..."]:
        """Values on the scenario's scale of values in the user's unit."""
        return np.asarray((np.asarray(values, np.float64) - self.value_at_zero) / self._span)

    def to_user_values(self, values: HostValues) -> Float[np.ndarray, "..."]:
        """Values in the user's unit of values on the scenario's scale."""
        return np.asarray(np.asarray(values, np.float64) * self._span + self.value_at_zero)

    def to_user_std(self, std: HostValues) -> Float[np.ndarray, "..."]:
        """Standard deviations and errors in the user's unit: scaled, not shifted."""
        return np.asarray(np.asarray(std, np.float64) * self.std)

    def standardised(self, mean: float, std: float, *, below: bool = False) -> "GeoReference":
        """The same place, its values with this mean and standard deviation; with `below` low ones become high."""
        return replace(self, value_at_zero=mean, value_at_one=mean - std if below else mean + std)

    def shifted(self, level: float, scale: float) -> "GeoReference":
        """The same place; where it had the values `level` and `level + scale`, it has 0 and 1."""
        zero, one = (self.value_at_zero + at * self._span for at in (level, level + scale))
        return replace(self, value_at_zero=zero, value_at_one=one)

    @property
    def for_pictures(self) -> "GeoReference":
        """The affine map to user coordinates: in degrees only near enough, as meridians are not parallel.

        At 150 km and 50 degrees of latitude the corners are 0.4 % of the side off, ten times less at 15 km.
        """
        if self.user is None:
            return self
        width, height = self.domain
        middle = np.array([[0.0, height / 2], [width, height / 2], [width / 2, 0.0], [width / 2, height]])
        west, east, south, north = self.to_user(middle)
        if self.geographic:
            east[0] += 360.0 * (east[0] < west[0])
        size = (float(east[0] - west[0]), float(north[1] - south[1]))
        return replace(self, origin=(float(west[0]), float(south[1])), size=size, plane=self.user, user=None)

    @property
    def _span(self) -> float:
        return self.value_at_one - self.value_at_zero

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, texts and lists, ready for JSON; systems by their names."""
        own = {name: getattr(self, name) for name in self.__dataclass_fields__}
        plane, user = own.pop("plane"), own.pop("user")
        return {**own, "plane": plane.to_dict(), "user": None if user is None else user.to_dict()}
