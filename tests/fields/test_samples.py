"""Samples from CSV in the forms that people have, and one line for each that cannot be read."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.fields.samples import load_samples

X, Y, V = [9.1, 9.25, 9.3], [47.5, 47.52, 47.6], [1.5, -2.0, 30.0]


def read(path, content, **named):
    file = path / "samples.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_samples(file, **named)


FORMS = {
    "plain": ("lon,lat,chl\n9.1,47.5,1.5\n9.25,47.52,-2\n9.3,47.6,30\n", {}),
    "no header": ("9.1,47.5,1.5\n9.25,47.52,-2\n9.3,47.6,30\n", {}),
    "blanks": ("9.1 47.5 1.5\n 9.25  47.52 -2e0\n9.3\t47.6 30\n", {}),
    "other order, units in names": (
        "Chl [ug/L],Latitude (deg),Longitude (deg)\n1.5,47.5,9.1\n-2,47.52,9.25\n30,47.6,9.3\n", {}),
    "decimal comma": ("\ufeffEasting;Northing;Wert\r\n9,1;47,5;1,5\r\n9,25;47,52;-2,0\r\n9,3;47,6;30\r\n", {}),
    "tabs and decimal comma": ("x\ty\tz\n9,1\t47,5\t1,5\n9,25\t47,52\t-2\n9,3\t47,6\t3,0E1\n", {}),
    "quotes and comments": (
        '# drawn in May\n"x","y","salt, g/kg"\n"9.1","47.5","1.5"\n# rain\n9.25, 47.52, -2\n\n9.3,47.6,"30"\n', {}),
    "commented header": ("# east of the dam\n# lat,lon,v\n47.5,9.1,1.5\n47.52,9.25,-2\n47.6,9.3,30\n", {}),
    "time and text beside": (
        "station;date;lon;lat;temp;note\nA;2024-05-01;9.1;47.5;1.5;\nB;2024-05-01;9.25;47.52;-2;windy\n"
        "C;2024-05-02;9.3;47.6;30;\n", {}),
    "numbers that are no values": (
        "id,time,x,y,depth\n1,100,9.1,47.5,1.5\n2,110,9.25,47.52,-2\n3,120,9.3,47.6,30\n", {}),
    "value by name": ("x,y,ph,chl\n9.1,47.5,7,1.5\n9.25,47.52,7,-2\n9.3,47.6,8,30\n", {"value": "CHL"}),
    "all by name": (
        "a,b,c,d\n9.1,47.5,7,1.5\n9.25,47.52,7,-2\n9.3,47.6,8,30\n", {"x": "a", "y": "b", "value": "d"}),
    "a line of units": (
        "time,latitude,longitude,chlor\nUTC,degrees_north,degrees_east,mg m-3\n2024-01-01T00:00:00Z,47.5,9.1,1.5\n"
        "2024-01-01T00:00:00Z,47.52,9.25,-2\n2024-01-01T00:00:00Z,47.6,9.3,30\n", {}),
    "a spreadsheet's hint": ("sep=;\nx;y;v\n9.1;47.5;1.5\n9.25;47.52;-2\n9.3;47.6;30;;\n", {}),
    "old encoding": ("lon,lat,Trübung µg\n9.1,47.5,1.5\n9.25,47.52,-2\n9.3,47.6,30\n".encode("cp1252"), {}),
    "utf-16": ("lon\tlat\tv\n9.1\t47.5\t1.5\n9.25\t47.52\t-2\n9.3\t47.6\t30\n".encode("utf-16"), {}),
    "a note over two lines": ('x,y,v,note\n9.1,47.5,1.5,"wind\nand rain"\n9.25,47.52,-2,\n9.3,47.6,30,\n', {}),
    "an instrument's preamble": (
        "KorEXO Measurement File Export\nFILE CREATED:,08/12/2026,,\nDEVICE:,EXO2,,\n\nlon,lat,chl\n9.1,47.5,1.5\n"
        "9.25,47.52,-2\n9.3,47.6,30\n", {}),
    "a preamble of full width": (
        "Logger;;\nStart:;2026-05-01;\nlon;lat;chl\ndeg;deg;ug/L\n9,1;47,5;1,5\n9,25;47,52;-2\n9,3;47,6;30\n", {}),
    "degrees and minutes": (
        "Longitude,Latitude,chl\n9° 6' E,47°30'0\" N,1.5\n9 15 E,N 47 31.2,-2\n9.3 east,47.6 North,30\n", {}),
    "a receiver's own": ("lat,NS,lon,EW,v\n4730.00,N,906,E,1.5\n4731.2,N,915,E,-2\n4736,N,918,E,30\n", {}),
    "beyond the range": ("x,y,v\n9.1,47.5,<3\n9.25,47.52,-2\n9.3,47.6,> 30\n", {}),
    "lon_deg": ("lat_deg,lon_deg,v\n47.5,9.1,1.5\n47.52,9.25,-2\n47.6,9.3,30\n", {}),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_samples(form, tmp_path):
    content, named = FORMS[form]
    samples = read(tmp_path, content, **named)
    # Minutes are sixtieths, which round.
    np.testing.assert_allclose(samples.x, X, rtol=1e-15)
    np.testing.assert_allclose(samples.y, Y, rtol=1e-15)
    np.testing.assert_array_equal(samples.value, V)
    np.testing.assert_array_equal(samples.points, np.stack([samples.x, samples.y], axis=1))
    assert samples.dropped == 0 and samples.source == str(tmp_path / "samples.csv")


def test_names_tell_degrees(tmp_path):
    assert read(tmp_path, "lon,Latitude (deg),v\n9,47,1\n").geographic
    assert not read(tmp_path, "x,y,v\n9,47,1\n").geographic
    assert read(tmp_path, "lon,lat,chl [ug/L]\n9,47,1\n").names == ("lon", "lat", "chl [ug/L]")


@pytest.mark.parametrize("missing", ["", "NaN", "n/a", "NULL", "--", "inf"])
def test_lines_without_a_value_are_dropped_and_counted(missing, tmp_path):
    samples = read(tmp_path, f"x,y,v\n1,2,3\n4,5,{missing}\n{missing},8,9\n7,8,9\n")
    assert samples.dropped == 2
    np.testing.assert_array_equal(samples.x, [1, 7])
    assert np.isfinite(samples.points).all() and np.isfinite(samples.value).all()


def test_limits_and_what_looks_like_no_value_are_named_by_line(tmp_path):
    rows = "\n".join(f"{i},{i + 1},{i % 5}" for i in range(20))
    samples = read(tmp_path, f"x,y,v\n{rows}\n1,2,<0.5\n1,2,≤ 1\n1,2,>9\n1,2,-9999\n1,2,9999\n")
    assert samples.value[-3:].tolist() == [0.25, 0.5, 9.0] and samples.lines[-3:].tolist() == [22, 23, 24]
    assert samples.notes == (
        "2 lines (22, 23) below detection; half the limit is taken",
        "1 line (24) above the range; the limit is taken",
        "2 lines (25, 26) with -9999, 9999, which looks like no value; left out",
    )


def test_hemispheres_say_degrees(tmp_path):
    south = read(tmp_path, "x,y,v\n9.5 W,47.25 S,1\n")
    assert south.geographic and south.points.tolist() == [[-9.5, -47.25]]


BAD = {
    "empty": ("", {}, "empty"),
    "comments only": ("# x,y,v\n", {}, "empty"),
    "header only": ("x,y,v\n", {}, "no line of numbers below"),
    "no x": ("a,y,v\n1,2,3\n", {}, "line 1: no x column among a, y, v; name it x or longitude"),
    "no y": ("lon,b,v\n1,2,3\n", {}, "line 1: no y column among"),
    "no header, four columns": ("1,2,3,4\n", {}, r"no header.*line 1 has 4 columns"),
    "two x": ("lon,lat,x,v\n1,2,3,4\n", {}, r"more than one x column \(lon, x\).*x=NAME"),
    "two values": ("x,y,a,b\n1,2,3,4\n", {}, r"more than one column of numbers \(a, b\).*value=NAME"),
    "no values": ("x,y,time\n1,2,3\n", {}, "no column of numbers"),
    "unknown value": ("x,y,a,b\n1,2,3,4\n", {"value": "c"}, "no column 'c' for the value; there is: x, y, a, b"),
    "value is a position": ("x,y,a\n1,2,3\n", {"value": "x"}, "'x' is a position"),
    "same column twice": ("x,y,a\n1,2,3\n", {"y": "x"}, "both x and y"),
    "named twice": ("x,y,a,a\n1,2,3,4\n", {"value": "a"}, "more than one column is named 'a'"),
    "text": ("x,y,v\n1,2,3\n\n4,five,6\n", {}, "line 4, column 2: 'five' is not a number"),
    "text as value": ("x,y,v\n1,2,3\n4,5,low\n", {}, "line 3, column 3: 'low' is not a number"),
    "underscore": ("x,y,v\n1,2,1_000\n", {"value": "v"}, "line 2, column 3: '1_000' is not a number"),
    "both marks": ("x;y;v\n1;2;1.234,5\n", {"value": "v"}, "line 2, column 3: '1.234,5'"),
    "decimal comma among commas": ("x,y,v\n1,5,2,5,3,5\n", {}, "line 2: 6 columns where the header names 3.*semicolon"),
    "ragged": ("x,y,v\n1,2,3\n4,5\n", {}, "line 3: 2 columns where the header names 3"),
    "all missing": ("x,y,v\n1,2,\n3,,4\n", {"value": "v"}, r"no line has a position and a value \(2 lines"),
    "no place": ("lon,lat,v\n9,47,1\n500000,5200000,2\n", {}, "line 3: lon=500000.*no place on Earth.*metres"),
    "binary": (b"x,y,v\n\x00\x01", {}, "not text"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_give_one_line_naming_file_and_problem(case, tmp_path):
    content, named, problem = BAD[case]
    with pytest.raises(InputError, match=problem) as caught:
        read(tmp_path, content, **named)
    message = str(caught.value)
    assert message.startswith(str(tmp_path)) and "\n" not in message


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_samples(tmp_path / "none.csv")
    with pytest.raises(InputError, match="no such file"):
        load_samples(tmp_path)


pieces = st.sampled_from(
    ["lon", "lat", "x", "y", "v", ",", ";", "\t", "\n", '"', "#", "1", "2,5", ".3", "nan", "-", " "]
)


@settings(max_examples=300)
@given(st.one_of(st.lists(pieces, max_size=40).map("".join).map(str.encode), st.binary(max_size=60)))
@example(b'x,y,v\n1,2,"3\n')
@example(b"\xff\xfe1")
def test_any_bytes_give_samples_or_one_line(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content)
    try:
        samples = load_samples(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert len(samples.value) >= 1 and np.isfinite(samples.points).all() and np.isfinite(samples.value).all()


finite = st.floats(-1e6, 1e6).filter(lambda number: set(f"{abs(number):g}") != {"9"})  # which stand for no value


@given(st.lists(st.tuples(*[finite] * 3), min_size=1, max_size=20), st.sampled_from([",", ";", "\t"]))
def test_what_is_written_is_read_back(tmp_path_factory, rows, separator):
    path = tmp_path_factory.getbasetemp() / "back.csv"
    lines = [separator.join(repr(number) for number in row) for row in rows]
    path.write_text("\n".join([separator.join(["x", "y", "v"]), *lines]))
    samples = load_samples(path)
    np.testing.assert_array_equal(np.column_stack([samples.points, samples.value]), rows)
