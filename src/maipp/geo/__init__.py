"""Where things are and what their numbers mean: coordinate reference systems, and the way between people and domain.

A `Crs` says what the coordinates of a file are: degrees, metres, feet, on which datum. `transform` leads from one to
another. A `GeoReference` is one domain in them: from the coordinates and values that people write to domain units and
standardised values, and back. Readers make the first from their file; plans, evaluations, surveys, live surveys,
records and reports carry the second. Projections are pyproj's, which the extra `maipp[geo]` brings.
"""

from maipp.geo.crs import METRES, PLANE, WGS84, Crs, local_crs, read_crs
from maipp.geo.reference import GeoReference
from maipp.geo.transform import check_degrees, ground_scale, transform, unwrap, wrap

__all__ = [
    "METRES",
    "PLANE",
    "WGS84",
    "Crs",
    "GeoReference",
    "check_degrees",
    "ground_scale",
    "local_crs",
    "read_crs",
    "transform",
    "unwrap",
    "wrap",
]
