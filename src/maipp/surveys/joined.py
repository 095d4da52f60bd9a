"""Measurements without positions, joined by time to the track of the boat that carried the sensor."""

from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maipp.errors import InputError
from maipp.fields.csv_table import read_table
from maipp.fields.readings import readings
from maipp.fields.sample_columns import DEGREES, position_column, value_column, words
from maipp.fields.samples import Samples, positions, strays
from maipp.fields.times import times_of, utc
from maipp.files import read_bytes
from maipp.surveys.mission_file import SampleFile
from maipp.surveys.shapes.gpx import place_of, track_points
from maipp.surveys.shapes.xml_text import LARGEST, parse_xml, text_of
from maipp.typing import Float

_LONGEST_GAP = 60.0  # seconds between two points of a track that a position is interpolated over


class Track(NamedTuple):
    """Where a boat was and when, in the order of time."""

    seconds: Float[np.ndarray, " n"]
    points: Float[np.ndarray, "n 2"]
    names: tuple[str, str]  # of the columns
    in_degrees: bool


def joined(file: SampleFile) -> Samples:
    """The samples of a file with times in place of positions: each where its track was when the sensor measured it.

    That is at the time of its line, `offset_s` later on the track's clock, `lag_s` before. Values measured before,
    after or in a gap of the track of more than a minute are left out, and told. Raises `InputError` naming file and
    line of what cannot be read, and where no value was measured on the track.
    """
    assert file.track is not None
    table = read_table(file.file)
    if table.header is None:
        raise InputError(f"{file.file}: has no header; name the columns in its first line, such as time,value")
    clock = times_of(table, table.header, file.time)
    column = value_column(table, table.header, clock.columns, file.value)
    values, notes = readings(table, column)
    track = load_track(file.track, file)
    moments = clock.seconds + file.offset_s - file.lag_s
    whole = np.isfinite(moments) & np.isfinite(values)
    whole[whole] = ~strays(values[whole])
    at = np.clip(np.searchsorted(track.seconds, moments), 1, len(track.seconds) - 1)
    near = track.seconds[at] - track.seconds[at - 1] <= _LONGEST_GAP
    on = (moments >= track.seconds[0]) & (moments <= track.seconds[-1]) & near
    kept = whole & on
    if not kept.any():
        begins = np.nanmin(moments) if np.isfinite(moments).any() else np.nan
        raise InputError(
            f"{file.file}: none of its {int(whole.sum())} values was measured on the track of {file.track}: they begin "
            f"{_moment(begins)}, the track {_moment(track.seconds[0])}; give offset_s, what to add to the clock of the "
            f"values ({track.seconds[0] - begins + file.offset_s:.0f} makes them begin together)"
        )
    if (off := int((whole & ~on).sum())) > 0:
        notes.append(f"{off} of {int(whole.sum())} values were not measured on the track; left out")
    x, y = (np.interp(moments[kept], track.seconds, track.points[:, axis]) for axis in (0, 1))
    names = track.names[0], track.names[1], table.header[column]
    lines = np.array(table.lines)[kept]
    dropped = int((~whole).sum())
    return Samples(x, y, values[kept], names, str(file.file), lines, dropped, tuple(notes), track.in_degrees)


def load_track(path: Path, file: SampleFile) -> Track:
    """The track in a CSV file with times and positions, or in a GPX file. Raises `InputError` for what is none."""
    track = _gpx_track(path) if path.suffix.lower() == ".gpx" else _csv_track(path, file)
    whole = np.isfinite(track.seconds) & np.isfinite(track.points).all(axis=1)
    order = np.flatnonzero(whole)[np.argsort(track.seconds[whole], kind="stable")]
    if len(order) < 2:
        raise InputError(f"{path}: has {len(order)} points with a time and a place; a track needs two")
    return track._replace(seconds=track.seconds[order], points=track.points[order])


def _csv_track(path: Path, file: SampleFile) -> Track:
    table = read_table(path)
    if table.header is None:
        raise InputError(f"{path}: has no header; name the columns in its first line, such as time,lon,lat")
    header = table.header
    columns = position_column(table, header, file.x, "x"), position_column(table, header, file.y, "y")
    (x, x_degrees), (y, y_degrees) = (positions(table, i, axis) for i, axis in zip(columns, "xy", strict=True))
    names = header[columns[0]], header[columns[1]]
    named = all(words(name)[:1] in [[each] for each in DEGREES] for name in names)
    seconds = times_of(table, header, file.track_time).seconds
    return Track(seconds, np.stack([x, y], axis=-1), names, x_degrees or y_degrees or named)


def _gpx_track(path: Path) -> Track:
    root = parse_xml(read_bytes(path, "track", LARGEST), str(path), "GPX file")
    seconds, places = [], []
    for _, points in track_points(root, str(path)):
        for point in points:
            text = text_of(point, "time")
            try:
                seconds.append(utc(datetime.fromisoformat(text)) if text else np.nan)
            except ValueError:
                raise InputError(f"{path}: {text[:40]!r} is no time") from None
            places.append(place_of(point, str(path)))
    return Track(np.array(seconds), np.array(places).reshape(-1, 2), ("lon", "lat"), True)


def _moment(seconds: float) -> str:
    """A time of a clock, or a count of seconds."""
    if not 1e8 < seconds < 1e11:
        return f"at {seconds:.10g} s"
    return f"on {datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S} UTC"
