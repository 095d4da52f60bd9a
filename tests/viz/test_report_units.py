"""Numbers are written so that a person can read them, and lengths in the unit that the person knows."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.fields.raster import Raster, RasterData
from maipp.geo import METRES, PLANE, WGS84, GeoReference
from maipp.viz.report_survey import SurveyReport
from maipp.viz.report_units import (
    decimals,
    length_unit,
    nice_step,
    number,
    percent,
    setting,
    time_unit,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1234567.0, "1\u202f234\u202f567"),
        (54.23, "54.2"),
        (0.05568, "0.0557"),
        (-2.0, "-2.00"),
        (3e-9, "3.00e-09"),
        (math.nan, "unknown"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


@given(st.floats(1e-5, 1e8), st.integers(2, 5))
def test_a_number_is_right_to_its_digits(value, digits):
    assert float(number(value, digits).replace("\u202f", "")) == pytest.approx(value, rel=0.51 * 10 ** (1 - digits))


@pytest.mark.parametrize(("value", "text"), [(0.4, "0.4"), (150.0, "150"), (0.0, "0"), (2.5, "2.5"), (100.0, "100")])
def test_settings_have_no_idle_zeros(value, text):
    assert setting(value) == text


def test_shares():
    pairs = (1.0, 2.0), (0.0, 2.0), (0.01, 2.0), (1.0, 0.0)
    assert [percent(*pair) for pair in pairs] == ["50 %", "0 %", "0.5 %", "none"]


@given(st.floats(1e-6, 1e7), st.integers(1, 200))
def test_steps_are_round_and_as_few_as_asked(span, steps):
    step = nice_step(span, steps)
    assert math.ceil(span / step * (1 - 1e-6)) <= steps
    assert step <= 2.5 * span / steps * (1 + 1e-6)
    leading = step / 10 ** math.floor(math.log10(step) + 1e-9)
    assert min(abs(leading - nice) for nice in (1, 2, 2.5, 5)) < 1e-6


@given(st.floats(1e-4, 1e6))
def test_decimals_tell_places_of_an_area_apart(extent):
    assert 10.0 ** -decimals(extent, 4) <= max(extent / 100, 1.0)


def test_lengths_are_metres_where_these_are_known(episode):
    def unit_of(**facts):
        there = GeoReference((0.0, 0.0), (100.0, 50.0), (1.0, 0.5))
        return length_unit(SurveyReport(dataclasses.replace(episode, reference=dataclasses.replace(there, **facts))))

    assert length_unit(SurveyReport(episode)).text(0.5) == "0.500 domain units"
    assert unit_of(metres_per_unit=200.0).text(0.5) == "100 m"
    assert unit_of(metres_per_unit=50_000.0).text(0.5) == "25.0 km"
    assert unit_of().text(0.5) == "50.0 map units"
    # A unit of x and one of y that differ: no length follows from them.
    assert unit_of(size=(100.0, 70.0)).name == "domain units"


def test_degrees_are_what_the_file_says_and_never_guessed(episode):
    # Review A7: metres in the proportions of degrees, and degrees on both sides of the equator.
    y = np.linspace(-0.7, 0.7, 15)
    data = RasterData(np.arange(225.0).reshape(15, 15), np.linspace(0.0, 2.8, 15), y)

    def report(crs):
        there = Raster.from_data(dataclasses.replace(data, crs=crs)).reference
        scenario = episode.scenario.replace(extent=there.domain)
        return SurveyReport(dataclasses.replace(episode, scenario=scenario, reference=there))

    metres, degrees = report(METRES), report(WGS84)
    assert length_unit(metres).text(0.5) == "1.40 m" and metres.x_label == "x"
    assert length_unit(degrees).text(0.5) == "156 km" and degrees.x_label == "longitude (°)"
    assert length_unit(report(PLANE)).text(0.5) == "1.40 map units"


@pytest.mark.parametrize(("seconds", "name"), [(100.0, "s"), (3000.0, "min"), (50_000.0, "h"), (None, "")])
def test_times_are_in_a_fitting_unit(episode, seconds, name):
    assert time_unit(SurveyReport(episode, seconds_per_time=seconds)).name == name
