"""Rehearsals: the same fields for every team, measures that follow from the beliefs, and what they say in words."""

import csv
import dataclasses
import io
import math
import re

import jax
import numpy as np
import pytest

from maipp.bench.sweep.dealing import Where
from maipp.errors import InputError
from maipp.surveys.mission_file import Rehearsal
from maipp.surveys.rehearsal import RehearsalResult, RehearsedTeam, rehearse, with_robots
from maipp.surveys.rehearsal_figure import draw_rehearsal
from maipp.surveys.rehearsal_report import markdown, rows, summary_table, to_csv, words, write_report
from maipp.surveys.spread import spread
from maipp.surveys.survey_io import parse_survey
from tests.surveys.conftest import SQUARE

SURVEY = parse_survey(SQUARE, source="mission.yaml")
FIELDS = 6


@pytest.fixture(scope="module")
def rehearsed():
    return rehearse(SURVEY, rehearsal=Rehearsal(fields=FIELDS), seed=2)


def test_every_size_of_team_meets_the_same_fields(rehearsed):
    one, two = rehearsed.teams
    assert (one.robots, two.robots) == (1, 2) and one.planner == two.planner == "shared-greedy"
    assert all(getattr(one, name).shape == (FIELDS,) for name in ("trace", "rmse", "found", "minutes"))
    assert one.rmse_before == pytest.approx(two.rmse_before) and one.trace_before == pytest.approx(two.trace_before)
    # Before the survey the map is the prior mean: its error is that of the field, in the unit (std 4).
    assert 2 < one.rmse_before.mean() < 6


def test_measuring_lowers_uncertainty_and_error_on_average(rehearsed):
    one, two = rehearsed.teams
    assert two.trace.mean() < one.trace.mean() < one.trace_before.mean()
    assert two.rmse.mean() < one.rmse_before.mean()
    assert (one.distance <= 1500.5).all() and (one.minutes <= 12.51).all()
    assert (two.minutes <= 20.01).all() and (two.distance <= 1500 + 1200 + 1).all()
    shares = np.concatenate([one.found, two.found])
    assert ((shares >= 0) & (shares <= 1) | np.isnan(shares)).all()


def test_robots_beyond_the_file_s_are_copies_of_its_last():
    team = with_robots(SURVEY, 4).robots
    assert [robot.name for robot in team] == ["one", "two", "robot-3", "robot-4"]
    assert team[3] == dataclasses.replace(team[1], name="robot-4")
    assert with_robots(SURVEY, 1).robots == SURVEY.robots[:1]
    taken = dataclasses.replace(SURVEY, robots=(dataclasses.replace(team[0], name="robot-2"),))
    assert with_robots(taken, 2).robots[1].name == "robot-2-more"


def test_a_raster_stands_for_the_truth(tmp_path):
    x = np.linspace(-50, 1050, 23)
    path = tmp_path / "map.npz"
    np.savez(path, value=10 + 4 * np.sin(x / 200)[None] * np.cos(x / 300)[:, None], x=x, y=x)
    survey = dataclasses.replace(SURVEY, threshold=None)
    result = rehearse(survey, robots=[1], rehearsal=Rehearsal(raster=path, fields=2))
    (team,) = result.teams
    assert result.on == str(path) and team.trace.shape == (2,)
    assert team.rmse_before[0] == pytest.approx(team.rmse_before[1])  # one truth
    assert (team.rmse < team.rmse_before).all()
    assert np.isnan(team.found).all()  # without a threshold nothing is of high interest
    np.savez(path, value=np.arange(4.0).reshape(2, 2), x=[0, 100], y=[0, 100])
    with pytest.raises(InputError, match=r"map.npz: covers \d+% of the area"):
        rehearse(SURVEY, robots=[1], rehearsal=Rehearsal(raster=path, fields=2))


def test_the_map_of_a_foresight_is_scored_beside_the_belief_s(rehearsed, tmp_path):
    result = rehearse(SURVEY, rehearsal=Rehearsal(fields=FIELDS), seed=2, foresight="fitted")
    for plain, own in zip(rehearsed.teams, result.teams, strict=True):
        np.testing.assert_array_equal(plain.rmse, own.rmse)  # the survey is the same
        assert set(own.maps) == {"fitted_rmse", "fitted_68", "fitted_95", "belief_68", "belief_95"} and not plain.maps
        # Fields drawn from the belief's own kernel: the map that need not know its scale is hardly worse, in the unit.
        assert 0.7 < own.maps["fitted_rmse"].mean() / own.rmse.mean() < 1.3
        assert (own.maps["fitted_68"] <= own.maps["fitted_95"]).all() and own.maps["belief_95"].mean() > 0.8
    heading, first, *_ = csv.reader(io.StringIO(to_csv(result)))
    assert heading[-5:] == list(result.teams[0].maps) and float(first[-5]) > 0
    assert rows(result)[0][5] == "RMSE, fitted" and "map of the foresight fitted, 2 robots" in words(result)[-1]
    assert "RMSE, fitted" in markdown(result) and "fitted" not in markdown(rehearsed)


def test_processes_come_to_the_same(rehearsed):
    shared = rehearse(SURVEY, rehearsal=Rehearsal(fields=FIELDS), seed=2, where=Where(workers=2))
    for here, there in zip(rehearsed.teams, shared.teams, strict=True):
        assert (here.planner, here.robots) == (there.planner, there.robots)
        # A process has one device where this one has two: other batches round otherwise.
        np.testing.assert_allclose(there.rmse, here.rmse, rtol=1e-3)
        np.testing.assert_allclose(there.minutes, here.minutes, rtol=1e-3)


def test_without_a_threshold_nothing_is_to_be_found():
    lost = team(1, [1, 2], [3, 4], found=math.nan)
    result = RehearsalResult(dataclasses.replace(SURVEY, threshold=None), (lost,), 2, "drawn fields", ())
    assert rows(result)[1][5] == "-" and "found" not in words(result)[0]
    assert len(draw_rehearsal(result).axes) == 2


def team(robots, trace, error, found=0.5, planner="greedy"):
    values = np.asarray(trace, float)
    same = np.ones_like(values)
    return RehearsedTeam(
        planner, robots, values, 100 * same, np.asarray(error, float), 4 * same, found * same, 0 * same, same, same
    )


def result_of(*teams):
    return RehearsalResult(SURVEY, teams, len(teams[0].trace), "drawn fields", ("a warning",))


@pytest.mark.parametrize(
    ("trace", "error", "verdict"),
    [
        ([20, 22, 24, 26], [2, 2.1, 2.2, 2.3], "a clear gain"),
        ([38, 39.5, 41.5, 42.5], [2.9, 3.0, 3.1, 3.2], "a small gain"),
        ([60, 30, 55, 25], [4, 2, 4.1, 2.2], "no gain that these rehearsals show"),
    ],
)
def test_it_says_whether_a_further_robot_is_worth_it(trace, error, verdict):
    sentences = words(result_of(team(1, [40, 41, 43, 44], [3, 3.1, 3.2, 3.3]), team(2, trace, error)))
    assert sentences[0].startswith("1 robot with greedy: the error falls from 4 to 3.15 g/L (RMSE), and 50%")
    assert re.fullmatch(
        rf"2 robots instead of 1: the error changes by \S+ \(.*\) to \S+ g/L, {verdict}; "
        rf"the uncertainty left by \S+ \(.*\), {verdict}, and 50% instead of 50% .*",
        sentences[1],
    )


def test_a_gain_in_one_measure_hides_no_loss_in_the_other():
    less, more = team(1, [40, 41, 43, 44], [3, 3.1, 3.2, 3.3]), team(2, [20, 21, 22, 23], [3.2, 3.31, 3.39, 3.5])
    sentences = words(result_of(less, more))
    assert "the error changes by +6%" in sentences[1] and "a loss; the uncertainty left by -49%" in sentences[1]


def test_the_best_planner_is_told_and_whether_that_is_sure():
    noisy = result_of(team(1, [40, 10, 40, 10], [3, 3, 3, 3]), team(1, [10, 40, 10, 39], [3, 3, 3, 3], planner="di"))
    assert words(noisy)[0].startswith("di leaves the least uncertainty with 1 robot: 1% (")
    assert "do not tell apart" in words(noisy)[0]


def test_the_files_hold_every_number(rehearsed, tmp_path):
    assert write_report(rehearsed, tmp_path) == ["rehearsal.csv", "rehearsal.md", "rehearsal.png"]
    table = list(csv.DictReader(io.StringIO(to_csv(rehearsed))))
    assert len(table) == 2 * FIELDS and {row["robots"] for row in table} == {"1", "2"}
    assert float(table[0]["rmse"]) == pytest.approx(rehearsed.teams[0].rmse[0], rel=1e-5)
    page = (tmp_path / "rehearsal.md").read_text(encoding="utf-8")
    assert page.startswith("# square: 6 rehearsals on drawn fields") and page.count("| shared-greedy |") == 2
    assert "a warning" in markdown(result_of(team(1, [1, 2], [3, 4])))
    assert (tmp_path / "rehearsal.png").read_bytes().startswith(b"\x89PNG")
    assert summary_table(rehearsed).row_count == 2


def test_spread_leaves_out_what_does_not_count():
    found = spread(np.array([1.0, math.nan, 3.0]))
    assert (found.mean, found.low) == (2.0, 1.2) and found.std == pytest.approx(math.sqrt(2))
    assert math.isnan(spread(np.array([math.nan])).mean) and spread(np.array([2.0])).std == 0


@pytest.fixture(scope="module", autouse=True)
def _forget():
    yield
    jax.clear_caches()
