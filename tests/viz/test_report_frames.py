"""The slider's instants are few and round, and what they show is the belief of that moment."""

import dataclasses

import numpy as np
import pytest

from maipp.team.broadcast import Broadcast
from maipp.viz.report_frames import MOST_FRAMES, frame_times, frames_of, standing
from maipp.viz.report_grid import map_grid
from maipp.viz.report_survey import SurveyReport


@pytest.mark.parametrize("seconds", [None, 37.0, 1000.0, 86_400.0])
def test_instants_are_bounded_and_reach_the_end(episode, seconds):
    times = frame_times(SurveyReport(episode, seconds_per_time=seconds))
    assert times[0] == 0 and times[-1] == episode.end
    assert 20 <= len(times) <= MOST_FRAMES and (np.diff(times) > 0).all()
    np.testing.assert_allclose(np.diff(times)[:-1], times[1], rtol=1e-6)


def test_a_survey_that_went_nowhere_has_one_instant(episode):
    agents = tuple(
        dataclasses.replace(a, route=a.route[:1], route_time=a.route_time[:1], distance=0.0) for a in episode.agents
    )
    np.testing.assert_array_equal(frame_times(SurveyReport(dataclasses.replace(episode, agents=agents))), [0.0])


def test_frames_show_the_record(episode):
    report = SurveyReport(episode, reference=episode.geo.standardised(10.0, 4.0, below=True))
    frames = frames_of(report, map_grid(report))
    metrics = episode.metrics
    assert frames.trace[-1] == pytest.approx(metrics.trace, rel=1e-5)
    assert frames.rmse[-1] == pytest.approx(4 * metrics.rmse, rel=1e-5)
    assert frames.trace[0] == pytest.approx(metrics.curve_trace[0], rel=1e-5)
    # Before anything is measured the belief is the prior everywhere: 0 and 1, here 10 and 4.
    np.testing.assert_allclose(frames.mean[0], 10.0)
    np.testing.assert_allclose(frames.std[0], 4.0, rtol=1e-5)
    belief = episode.beliefs(np.array([episode.end + 1.0]))
    np.testing.assert_allclose(frames.mean[-1], 10 - 4 * belief.mean[0].reshape(9, 9).T, rtol=1e-5)
    np.testing.assert_array_equal(frames.surplus[-1] >= 0, belief.area[0].reshape(9, 9).T)
    true = (episode.truth >= episode.scenario.threshold) & episode.inside
    assert frames.found[-1] == pytest.approx((belief.area[0] & true).sum() / true.sum())
    assert frames.area[-1] == pytest.approx(belief.area[0].sum() / episode.inside.sum())


def test_without_a_truth_nothing_is_said_of_errors(episode):
    report = SurveyReport(episode, truth_known=False)
    frames = frames_of(report, map_grid(report))
    assert np.isnan(frames.rmse).all() and np.isnan(frames.found).all()


def told(agent, time):
    return Broadcast(agent, time, np.zeros(2), np.array([0.01, 0.0, 0.01]), np.empty((0, 2)), np.empty(0))


def test_what_was_told_stands_until_something_else_is():
    entries = (told(0, 0.5), told(1, 0.0), told(0, 0.0))
    index = standing(entries, 3, np.array([0.0, 0.4, 0.5, 2.0]))
    np.testing.assert_array_equal(index, [[2, 1, -1], [2, 1, -1], [0, 1, -1], [0, 1, -1]])
