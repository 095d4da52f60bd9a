"""Rehearsals with the kernel refitted under way, beside those without."""

import numpy as np
import pytest

from maipp.live.rehearse import refitted
from maipp.surveys.mission_file import Rehearsal
from maipp.surveys.rehearsal import REFITTED, rehearse
from maipp.surveys.rehearsal_report import words
from maipp.surveys.survey_io import parse_survey
from tests.surveys.conftest import SQUARE

FIELDS = 3


@pytest.fixture(scope="module")
def teams():
    survey = parse_survey(SQUARE, source="mission.yaml")
    result = rehearse(survey, robots=(2,), rehearsal=Rehearsal(fields=FIELDS), seed=2, refitted=refitted)
    return result, *result.teams


def test_each_team_is_rehearsed_once_more_on_the_same_fields(teams):
    _, fixed, other = teams
    assert other.planner == fixed.planner + REFITTED and other.robots == fixed.robots == 2
    np.testing.assert_array_equal(other.rmse_before, fixed.rmse_before)
    np.testing.assert_array_equal(other.trace_before, fixed.trace_before)
    for each in (fixed, other):
        assert (each.rmse > 0).all() and (each.rmse < each.rmse_before.max()).all()
        assert (each.distance <= 1500 + 1200 + 1).all() and (each.minutes <= 20.01).all()
        assert (each.distance > 1000).all()
    assert (other.rmse != fixed.rmse).any()


def test_fields_differ_in_length_scale(teams):
    """The field of a long one differs little within the area, that of a short one from place to place."""
    _, fixed, _ = teams
    assert len(set(fixed.rmse_before.round(6))) == FIELDS


def test_it_is_told_in_words(teams):
    result, fixed, other = teams
    (sentence,) = [each for each in words(result) if "refitted" in each]
    assert f"{other.rmse.mean():.3g}" in sentence and "cannot be compared" in sentence
    assert not any(fixed.planner + REFITTED in each for each in words(result))
