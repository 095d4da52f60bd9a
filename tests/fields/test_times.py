"""Times in the notations of loggers."""

from datetime import UTC, datetime

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fields.csv_table import read_table
from maipp.fields.times import times_of

NOON = datetime(2026, 5, 4, 12, 0, 30, 500_000, UTC).timestamp()


def times(folder, text, named=None):
    (folder / "a.csv").write_text(text)
    table = read_table(folder / "a.csv")
    assert table.header is not None
    return times_of(table, table.header, named)


@pytest.mark.parametrize(
    "text",
    [
        "time,v\n2026-05-04T12:00:30.5Z,1\n",
        "v,Timestamp (UTC)\n1,2026-05-04 12:00:30.500\n",
        "time,v\n2026-05-04T14:00:30.5+02:00,1\n",
        "Date,Time,v\n04.05.2026,12:00:30.5,1\n",
        "Date (MM/DD/YYYY),Time (HH:mm:ss),Time (Fract. Sec),v\n5/4/2026,12:00:30,0.5,1\n",
        "Date (DD/MM/YYYY),Time,v\n4/5/26,12:00:30.5 PM,1\n",
        f"time,v\n{NOON!r},1\n",
        f"time,v\n{NOON * 1000!r},1\n",
    ],
)
def test_a_moment_in_many_notations(text, tmp_path):
    found = times(tmp_path, text)
    np.testing.assert_allclose(found.seconds, [NOON], atol=1e-3)


def test_days_and_months_are_told_apart_by_the_other_lines(tmp_path):
    text = "date,time,v\n{}/{}/2026,10:00,1\n{}/{}/2026,10:00,1\n"
    for first, second, order in ((4, 5, (13, 5)), (5, 4, (5, 13))):
        found = times(tmp_path, text.format(first, second, *order)).seconds
        assert found[1] - found[0] == 9 * 86400


def test_missing_times_and_counted_seconds(tmp_path):
    assert np.isnan(times(tmp_path, "time,v\n2026-05-04T12:00Z,1\n,2\n").seconds[1])
    np.testing.assert_array_equal(times(tmp_path, "clock,time,v\na,0.5,1\nb,1.5,2\n").seconds, [0.5, 1.5])


@pytest.mark.parametrize(
    ("text", "named", "problem"),
    [
        ("v,w\n1,2\n", None, r"time must be in one column \(none among v, w\)"),
        ("time,utc,v\n1,1,2\n", None, r"\(time, utc\); choose one with time=NAME"),
        ("time,v\n12:00,2\n", None, "times without a date, and there is no date column"),
        ("date,time,v\n4/5/2026,12:00,2\n", None, "dates such as 4/5 may be day/month or month/day"),
        ("time,v\n2026-05-04T12:00Z,1\nsoon,2\n", None, "line 3, column 1: 'soon' is no date and time"),
        ("time,v\n2026-13-04 12:00,1\n", None, "line 2, column 1: '2026-13-04 12:00' is no date and time"),
        ("time,v\n1,2\n", "clock", "no column 'clock' for the time"),
    ],
)
def test_what_is_no_time_is_told(text, named, problem, tmp_path):
    with pytest.raises(InputError, match=problem):
        times(tmp_path, text, named)
