"""What the page draws is the record in the user's coordinates, small, and plain JSON."""

import base64
import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.team.broadcast import Broadcast
from maipp.viz.report_data import INTENT_SHARE, packed, page_data
from maipp.viz.report_frames import frames_of
from maipp.viz.report_grid import map_grid
from maipp.viz.report_survey import Foreseen, SurveyReport


def data_of(report):
    grid = map_grid(report)
    return page_data(report, grid, frames_of(report, grid))


def unpacked(entry, shape):
    numbers = np.frombuffer(base64.b64decode(entry["numbers"]), "<u2").reshape(shape)
    return np.where(numbers == 65535, np.nan, entry["base"] + entry["step"] * numbers.astype(float))


pictures = hnp.arrays(
    np.float64, (2, 3, 4), elements=st.one_of(st.floats(-1e6, 1e6), st.just(np.nan), st.floats(-1e-3, 1e-3))
)


@given(pictures)
def test_packed_pictures_keep_four_digits_of_their_range(values):
    back = unpacked(packed(values), values.shape)
    np.testing.assert_array_equal(np.isnan(back), np.isnan(values))
    known = np.isfinite(values)
    if known.any():
        span = np.ptp(values[known])
        assert np.abs(back - values)[known].max() <= span / 65_000 + 1e-9 * np.abs(values[known]).max()


@given(pictures)
def test_packed_signs_are_kept(values):
    back = unpacked(packed(values, signed=True), values.shape)
    known = np.isfinite(values)
    np.testing.assert_array_equal(back[known] >= 0, values[known] >= 0)


def test_the_data_is_the_record(episode, mapping):
    there = dataclasses.replace(episode, reference=mapping)
    data = json.loads(json.dumps(data_of(SurveyReport(there, names=("a", "b"))), allow_nan=False))
    assert [robot["name"] for robot in data["robots"]] == ["a", "b"]
    for robot, agent in zip(data["robots"], episode.agents, strict=True):
        route, measured = robot["route"], robot["measured"]
        np.testing.assert_allclose(np.stack([route["x"], route["y"]], -1), mapping.to_user(agent.route), atol=1e-4)
        places = np.stack([measured["x"], measured["y"]], -1)
        np.testing.assert_allclose(places, mapping.to_user(agent.measurement_x), atol=1e-4)
        np.testing.assert_allclose(measured["value"], 30 - 20 * agent.measurement_y, rtol=1e-4)
        np.testing.assert_allclose(measured["time"], agent.measurement_time, rtol=1e-4)
    assert (data["axes"]["x"], data["axes"]["y"], data["axes"]["aspect"]) == ("longitude", "latitude", 2.0)
    count = len(data["frames"]["time"])
    final = unpacked(data["frames"]["mean"], (count, 9, 9))[-1]
    expected = 30 - 20 * episode.beliefs(np.array([episode.end + 1.0])).mean[0].reshape(9, 9).T
    np.testing.assert_allclose(final, expected, atol=0.01)
    truth = unpacked(data["truth"], (9, 9))
    np.testing.assert_allclose(truth, 30 - 20 * episode.truth.reshape(9, 9).T, atol=0.01)
    assert data["curve"]["trace"][-1] == pytest.approx(episode.metrics.trace, rel=1e-4)
    assert data["curve"]["distance"][0] == 0
    assert data["limits"]["value"][0] < data["value"]["threshold"] < data["limits"]["value"][1]
    (zone,) = data["no_go"]
    corners = mapping.to_user(np.array(episode.scenario.obstacles[0]))
    np.testing.assert_allclose(np.stack([zone["x"], zone["y"]], -1), corners, atol=1e-4)


def test_an_area_replaces_the_scenario_s_obstacles(episode):
    ring = np.array([[0.0, 0.0], [0.9, 0.0], [0.9, 0.45]])
    assert data_of(SurveyReport(episode, area=ring))["no_go"] == []
    both = data_of(SurveyReport(episode, area=ring, no_go=(ring / 3,)))
    assert len(both["no_go"]) == 1 and both["area"]["x"] == [0.0, 0.9, 0.9]
    west, south, east, north = both["axes"]["shown"]
    assert west < 0 and south < 0 and 0.9 < east < 1 and 0.45 < north < 0.5


def test_a_unit_in_the_file_s_name_is_found(episode, mapping):
    there = dataclasses.replace(episode, reference=dataclasses.replace(mapping, value_name="depth at low tide (m)"))
    named = data_of(SurveyReport(there))["value"]
    assert (named["name"], named["unit"]) == ("depth at low tide", "m")
    plain = data_of(SurveyReport(dataclasses.replace(episode, reference=mapping)))["value"]
    assert (plain["name"], plain["unit"]) == ("temperature", "")


def test_without_a_truth_there_is_none(episode):
    data = data_of(SurveyReport(episode, truth_known=False))
    assert data["truth"] is None and data["true_surplus"] is None
    assert set(data["frames"]["rmse"]) == {None}


def test_a_foresight_s_map_is_drawn_in_the_user_s_units(episode, mapping):
    seen = Foreseen("fitted", np.linspace(0.0, 1.25, 81), np.linspace(0.2, 0.1, 81))
    data = data_of(SurveyReport(dataclasses.replace(episode, reference=mapping), foreseen=seen))
    mean = mapping.to_user_values(seen.mean).reshape(9, 9).T
    np.testing.assert_allclose(unpacked(data["foreseen"]["mean"], (1, 9, 9))[0], mean, atol=1e-3)
    std = mapping.to_user_std(seen.std).reshape(9, 9).T
    np.testing.assert_allclose(unpacked(data["foreseen"]["std"], (1, 9, 9))[0], std, atol=1e-3)
    assert data["limits"]["value"][0] == pytest.approx(mean.min())
    assert data_of(SurveyReport(episode))["foreseen"] is None


def test_an_intent_is_an_ellipse_that_holds_most_of_it(episode):
    rng = np.random.default_rng(0)
    mean, covariance = np.array([0.4, 0.2]), np.array([[0.02, 0.008], [0.008, 0.01]])
    told = Broadcast(1, 0.0, mean, covariance[[0, 0, 1], [0, 1, 1]], np.empty((0, 2)), np.empty(0))
    data = data_of(SurveyReport(episode, broadcasts=(told,)))
    ellipse = data["told"][0]["ellipse"]
    ring = np.stack([ellipse["x"], ellipse["y"]], -1)
    from matplotlib.path import Path

    inside = Path(ring).contains_points(rng.multivariate_normal(mean, covariance, 20_000))
    assert inside.mean() == pytest.approx(INTENT_SHARE, abs=0.015)  # a polygon of 32 corners is a little smaller
    assert data["standing"][0] == [-1, 0]


def test_announced_places_are_kept_with_their_times(episode):
    nothing = np.full(2, np.nan), np.full(3, np.nan)
    told = Broadcast(0, 0.0, *nothing, np.array([[0.2, 0.2], [0.3, 0.3], [9, 9]]), np.array([0.1, 0.2, np.inf]))
    entry = data_of(SurveyReport(episode, broadcasts=(told,), seconds_per_time=60.0))["told"][0]
    assert entry == {"ellipse": None, "places": {"x": [0.2, 0.3], "y": [0.2, 0.3], "time": [6.0, 12.0]}}


def test_prior_samples_are_shown(episode):
    report = SurveyReport(episode, prior_x=np.array([[0.1, 0.2]]), prior_y=np.array([3.5]))
    assert data_of(report)["prior"] == {"x": [0.1], "y": [0.2], "value": [3.5]}
    assert data_of(report)["limits"]["value"][1] == 3.5
    assert data_of(SurveyReport(episode, prior_x=np.empty((0, 2)), prior_y=np.empty(0)))["prior"] is None


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        ({"names": ("one",)}, "names: 1 for 2 robots"),
        ({"seconds_per_time": 0.0}, "seconds_per_time: 0.0 is not a number > 0"),
        ({"reference": GeoReference.of_domain((1.0, 1.0))}, r"reference: its domain is \(1.0, 1.0\), the record's"),
        ({"prior_x": np.zeros((1, 2))}, "give both, or neither"),
        ({"prior_x": np.zeros((1, 2)), "prior_y": np.zeros(2)}, r"shapes \(1, 2\) and \(2,\)"),
        ({"area": np.zeros((2, 2))}, r"area: shape \(2, 2\); give \(v, 2\)"),
        ({"no_go": (np.full((3, 2), np.nan),)}, r"no_go\[0\]: shape"),
        ({"foreseen": Foreseen("fitted", np.zeros(81), np.zeros(9))}, r"foreseen: shapes \(81,\) and \(9,\)"),
        ({"broadcasts": (Broadcast(2, 0.0, *[np.zeros(2)] * 4),)}, "broadcasts: robot 2 of 2"),
    ],
)
def test_facts_that_contradict_are_told_in_one_line(episode, facts, message):
    with pytest.raises(InputError, match=message) as caught:
        SurveyReport(episode, **facts)
    assert "\n" not in str(caught.value)
