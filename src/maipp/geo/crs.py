"""Coordinate reference systems: what the coordinates of a file are, and how long a unit of them is."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from maipp.errors import InputError

# What people call the system of their GNSS receiver; it is known without pyproj.
_WGS84 = ("EPSG:4326", "4326", "WGS84", "WGS 84", "OGC:CRS84", "CRS84", "URN:OGC:DEF:CRS:OGC:1.3:CRS84")
_EXAMPLES = "EPSG:4326 (degrees of WGS84) or EPSG:25833 (metres)"


@dataclass(frozen=True)
class Crs:
    """A coordinate reference system; x is the longitude or the easting, whatever order its authority has."""

    name: str | None = None  # as pyproj reads it: EPSG:25833, WKT or a PROJ string; None: a plane of no known place
    geographic: bool = False  # longitude and latitude, in degrees but for some old systems in grads
    metres: float | None = None  # metres in a unit of a plane's coordinates; None where unknown, and where geographic

    @property
    def located(self) -> bool:
        """Whether it is known where on Earth a position is."""
        return self.name is not None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and texts, ready for JSON."""
        return {"crs": self.name, "geographic": self.geographic, "metres": self.metres}

    def __str__(self) -> str:
        if self.name is None:
            return "no coordinate reference system"
        name = self.name if len(self.name) <= 60 else self.name.split('"')[1:2][0] if '"' in self.name else "its own"
        unit = "degrees" if self.geographic else "metres" if self.metres == 1 else f"units of {self.metres:.7g} m"
        return f"{name} ({unit})"


PLANE = Crs()
METRES = Crs(metres=1.0)
WGS84 = Crs("EPSG:4326", geographic=True)


def read_crs(text: str, where: str) -> Crs:
    """The system that a code, a name, WKT or a PROJ string says; "none" is a plane of no known place.

    Raises `InputError`, beginning with `where`, for what is none, for one of no places on a map, and where pyproj is
    needed and missing.
    """
    if text.strip().upper() in _WGS84:
        return WGS84
    if text.strip().lower() == "none":
        return PLANE
    try:
        return _read(text.strip())
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def local_crs(centre: tuple[float, float]) -> Crs:
    """Metres east and north of a place (longitude, latitude): azimuthal equidistant, WGS84.

    Lengths are right to 0.1 % within 500 km of the centre; straight lines through it are geodesics.
    """
    longitude, latitude = centre
    name = f"+proj=aeqd +lat_0={latitude!r} +lon_0={longitude!r} +datum=WGS84 +units=m +no_defs"
    return Crs(name, metres=1.0)


def load_pyproj(what: str) -> Any:
    """The module pyproj. Raises `InputError` saying that `what` needs it."""
    try:
        import pyproj
    except ImportError:
        raise InputError(f"{what} needs pyproj; install it with: pip install 'maipp[geo]'") from None
    return pyproj


@lru_cache(maxsize=64)
def _read(text: str) -> Crs:
    shown = f"{text[:57]}..." if len(text) > 60 else text
    pyproj = load_pyproj(shown)
    try:
        crs = pyproj.CRS.from_user_input(text)
        parts = crs.sub_crs_list
        flat = (parts[0] if crs.is_compound and parts else crs).to_2d()
        factor = float(flat.axis_info[0].unit_conversion_factor) if flat.axis_info else 0.0
    except pyproj.exceptions.CRSError:
        raise InputError(
            f"{shown!r} is no coordinate reference system; give one such as {_EXAMPLES}, or none"
        ) from None
    if flat.is_engineering:  # a building site's own plane
        return Crs(metres=factor or None)
    if not (flat.is_geographic or flat.is_projected) or not factor:
        raise InputError(f"{shown!r} ({flat.type_name}) is no system of maps; give one such as {_EXAMPLES}, or none")
    if flat.equals(pyproj.CRS.from_epsg(4326), ignore_axis_order=True):
        return WGS84
    code = flat.to_epsg(min_confidence=100)
    name = f"EPSG:{code}" if code is not None else flat.to_wkt()
    return Crs(name, True) if flat.is_geographic else Crs(name, metres=factor)
