"""GPX files for tests, written by an independent library."""

from collections.abc import Iterable, Sequence
from datetime import datetime

import gpxpy.gpx

Points = Sequence[tuple[float, float]]  # longitude, latitude


def track(name: str | None, *segments: Points, times: Iterable[datetime] = ()) -> gpxpy.gpx.GPXTrack:
    """A track of these segments; `times` are those of all points in order."""
    made, clock = gpxpy.gpx.GPXTrack(name=name), iter(times)
    for points in segments:
        listed = [gpxpy.gpx.GPXTrackPoint(y, x, time=next(clock, None)) for x, y in points]
        made.segments.append(gpxpy.gpx.GPXTrackSegment(listed))
    return made


def gpx_text(*tracks: gpxpy.gpx.GPXTrack, routes: Iterable[gpxpy.gpx.GPXRoute] = (), waypoints: int = 0) -> str:
    """The text of a file of them, with some waypoints."""
    gpx = gpxpy.gpx.GPX()
    gpx.tracks += tracks
    gpx.routes += routes
    gpx.waypoints += [gpxpy.gpx.GPXWaypoint(53.4, 13.3)] * waypoints
    return gpx.to_xml()
