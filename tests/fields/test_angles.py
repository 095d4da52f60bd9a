"""Degrees in the notations of people and receivers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.fields.angles import angle, hemisphere


@pytest.mark.parametrize(
    ("text", "axis", "degrees"),
    [
        ("13° 19.0951' E", "x", 13 + 19.0951 / 60),
        ("53°24'25.4\" N", "y", 53 + 24 / 60 + 25.4 / 3600),
        ("53 24 25,4 S", "y", -(53 + 24 / 60 + 25.4 / 3600)),
        ("N 53 24.5", "y", 53 + 24.5 / 60),
        ("13.318252 W", "x", -13.318252),
        ("53.41 north", "y", 53.41),
        ("4.5 Ouest", "x", -4.5),
        ("-13:19:30", "x", -(13 + 19.5 / 60)),
        ("−13.5°", "x", -13.5),
        ("5324.42N", "y", 53 + 24.42 / 60),
        ("01319.0951E", "x", 13 + 19.0951 / 60),
    ],
)
def test_notations(text, axis, degrees):
    assert angle(text, axis) == pytest.approx(degrees, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "axis"),
    [
        ("13 E", "y"),
        ("53 N", "x"),
        ("13 61.0 E", "x"),
        ("13.5 30 E", "x"),
        ("-13 E", "x"),
        ("E 13 E", "x"),
        ("low", "x"),
        ("", "y"),
    ],
)
def test_what_is_no_angle_of_that_axis(text, axis):
    assert angle(text, axis) is None


@given(st.integers(0, 179), st.integers(0, 59), st.integers(0, 5999), st.sampled_from("EW"))
def test_what_is_written_is_read(degrees, minutes, hundredths, side):
    written = f"{degrees}° {minutes}' {hundredths / 100:.2f}\" {side}"
    expected = (degrees + minutes / 60 + hundredths / 360000) * (1 if side == "E" else -1)
    assert angle(written, "x") == pytest.approx(expected, abs=1e-9)


@given(st.text(alphabet="0123456789.,-°'\" NSEWnorth", max_size=20), st.sampled_from("xy"))
def test_any_text_is_an_angle_or_none(text, axis):
    found = angle(text, axis)
    assert found is None or isinstance(found, float)


def test_hemispheres():
    assert [hemisphere(word, "y") for word in ("N", " süd", "East", "")] == [1.0, -1.0, None, None]
