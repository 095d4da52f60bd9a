"""Targets of what instruments and models write: sondes, their tracks, gridded NetCDF."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import fuzz_forks
import numpy as np
from fuzz_check import Target

from maipp.fields import netcdf_apart
from maipp.fields.raster_io import load_raster
from maipp.surveys.joined import joined
from maipp.surveys.mission_file import SampleFile

_TRACK = b"time,lon,lat\n" + b"".join(f"2024-05-01T10:0{i}:00Z,4.73{i},52.24{i}\n".encode() for i in range(6))
_SONDE = b"Serial: 123\n\nDate,Time,chl ug/L\n" + b"".join(
    f"2024-05-01,10:0{i}:30,{9 + i / 4}\n".encode() for i in range(5)
)
_GPX = b'<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>%s</trkseg></trk></gpx>' % b"".join(
    f'<trkpt lat="52.24{i}" lon="4.73{i}"><time>2024-05-01T10:0{i}:00Z</time></trkpt>'.encode() for i in range(6)
)
_TIMES = (
    b"2024-05-01",
    b"10:02:30",
    b"T",
    b"Z",
    b"+02:00",
    b"1714557600",
    b"45413.4",
    b"-",
    b";",
    b"time",
    b"#",
    b"nan",
)


def _beside(name: str, content: bytes, read: Callable[[Path, Path], Any]) -> Callable[[Path], Any]:
    """Reads the mutated file beside a whole one of another kind."""

    def read_both(path: Path) -> Any:
        with tempfile.TemporaryDirectory() as folder:
            other = Path(folder) / name
            other.write_bytes(content)
            return read(path, other)

    return read_both


def _sonde(path: Path, track: Path) -> Any:
    return joined(SampleFile(file=path, track=track))


def _track(path: Path, sonde: Path) -> Any:
    return joined(SampleFile(file=sonde, track=path))


def _netcdf_seeds() -> list[bytes]:
    import xarray

    axes = {"time": [0], "lat": [52.0, 52.1, 52.2], "lon": [4.0, 4.1, 4.2, 4.3]}
    values = np.arange(12.0).reshape(1, 3, 4)
    grid = xarray.Dataset({"chl": (("time", "lat", "lon"), values)}, coords=axes)
    small = xarray.Dataset({"z": (("y", "x"), values[0])}, coords={"y": axes["lat"], "x": axes["lon"]})
    return [bytes(grid.to_netcdf(engine="scipy")), bytes(small.to_netcdf(engine="scipy")), _hdf5(small)]


def _netcdf(path: Path) -> Any:
    with patch.object(netcdf_apart, "reply_to", fuzz_forks.reply_to), patch.object(netcdf_apart, "SECONDS", 5.0):
        return load_raster(path)


def _hdf5(grid: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.nc"
        grid.to_netcdf(path, engine="h5netcdf")
        return path.read_bytes()


FIELD_FILE_TARGETS = {
    "sonde": Target(".csv", _beside("track.csv", _TRACK, _sonde), lambda: [_SONDE], _TIMES, slice=300),
    "track-csv": Target(".csv", _beside("sonde.csv", _SONDE, _track), lambda: [_TRACK], _TIMES, slice=300),
    "track-gpx": Target(".gpx", _beside("sonde.csv", _SONDE, _track), lambda: [_GPX], (b"<trkpt", *_TIMES), slice=300),
    "raster-nc": Target(".nc", _netcdf, _netcdf_seeds, (b"CDF\x01", b"\x89HDF", b"lat", b"time"), slice=150),
}
