"""Values without positions get those of the track that they were measured on."""

from datetime import UTC, datetime

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.surveys.joined import joined
from maipp.surveys.mission_file import SampleFile
from tests.shared.gpx_text import gpx_text
from tests.shared.gpx_text import track as boat_track

BEGIN = datetime(2026, 5, 4, 12, 0, 0, tzinfo=UTC).timestamp()


def clock(seconds):
    return datetime.fromtimestamp(BEGIN + seconds, UTC).isoformat()


def sonde(folder, seconds, preamble=""):
    rows = [f"{clock(s)},{20 + s / 100:.3f}" for s in seconds]
    (folder / "sonde.csv").write_text(preamble + "\n".join(["time,chl", *rows]) + "\n")
    return folder / "sonde.csv"


@pytest.fixture(params=["csv", "gpx", "boot"])
def track(request, tmp_path):
    """A boat that goes north by a thousandth of a degree a minute for ten minutes, and later on; the offset."""
    minutes = [*np.arange(0, 10.25, 0.25), 15, 15.25]
    if request.param == "gpx":
        clocks = [datetime.fromtimestamp(BEGIN + 60 * m, UTC) for m in minutes]
        points = [(13.0, 53 + m / 1000) for m in minutes]
        (tmp_path / "boat.gpx").write_text(gpx_text(boat_track(None, points, times=clocks)))
        return tmp_path / "boat.gpx", 0.0
    boot = request.param == "boot"
    rows = [f"{60 * m + 7 if boot else clock(60 * m)},{53 + m / 1000:.6f},13.0" for m in minutes]
    (tmp_path / "boat.csv").write_text("\n".join(["time,lat,lon", *rows]))
    return tmp_path / "boat.csv", 7 - BEGIN if boot else 0.0


def test_each_value_is_where_the_boat_was(track, tmp_path):
    path, offset = track
    file = sonde(tmp_path, [-60, 60, 90, 600, 700], "KorEXO\nFILE CREATED:,05/04/2026\n\n")
    samples = joined(SampleFile(file, track=path, offset_s=offset))
    np.testing.assert_allclose(samples.y, [53.001, 53.0015, 53.01], atol=1e-6)
    np.testing.assert_allclose(samples.x, 13.0)
    np.testing.assert_allclose(samples.value, [20.6, 20.9, 26.0])
    assert samples.lines.tolist() == [6, 7, 8] and samples.geographic
    assert samples.notes == ("2 of 5 values were not measured on the track; left out",)


def test_a_slow_sensor_measured_where_the_boat_was_before(track, tmp_path):
    path, offset = track
    samples = joined(SampleFile(sonde(tmp_path, [90]), track=path, offset_s=offset, lag_s=30.0))
    np.testing.assert_allclose(samples.y, [53.001], atol=1e-6)


def test_clocks_that_never_meet_are_told_with_the_offset_that_would(track, tmp_path):
    path, offset = track
    file = SampleFile(sonde(tmp_path, [7200]), track=path, offset_s=offset)
    with pytest.raises(InputError, match=r"none of its 1 values was measured on the track.*give offset_s") as error:
        joined(file)
    told = float(str(error.value).rpartition("(")[2].split()[0])
    assert told == pytest.approx(offset - 7200)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("1,2\n", "has no header"),
        ("time,lat,lon\n2026-05-04T12:00Z,53,13\n", "has 1 points with a time and a place"),
        ("time,lat\n2026-05-04T12:00Z,53\n", "no x column"),
    ],
)
def test_what_is_no_track_is_told(content, problem, tmp_path):
    (tmp_path / "boat.csv").write_text(content)
    with pytest.raises(InputError, match=problem):
        joined(SampleFile(sonde(tmp_path, [0]), track=tmp_path / "boat.csv"))
