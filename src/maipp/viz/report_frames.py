"""What the report shows at each instant of its time slider."""

from typing import NamedTuple

import numpy as np

from maipp.engine.area_found import area_found
from maipp.engine.observe import time_tolerance
from maipp.team.broadcast import Broadcast
from maipp.typing import Float, Int
from maipp.viz.report_grid import MapGrid
from maipp.viz.report_survey import SurveyReport
from maipp.viz.report_units import nice_step, time_unit

# A film of a minute at two a second; more make the file large and nothing clearer.
MOST_FRAMES = 60


class Frames(NamedTuple):
    """The instants of the slider, and the team's pooled belief at each in the user's units."""

    times: Float[np.ndarray, " k"]  # the scenario's unit of time
    mean: Float[np.ndarray, "k r c"]
    std: Float[np.ndarray, "k r c"]
    surplus: Float[np.ndarray, "k r c"]  # of the confidence bound over the threshold, normalised; area where >= 0
    trace: Float[np.ndarray, " k"]  # Tr(P) over the predicted high-interest area, normalised units squared
    area: Float[np.ndarray, " k"]  # predicted high-interest area as a share of the survey area
    spread: Float[np.ndarray, " k"]  # root mean variance in that area; 0 where it is empty
    rmse: Float[np.ndarray, " k"]  # of the mean over the survey area; NaN where the truth is not known
    expected_error: Float[np.ndarray, " k"]  # root mean variance over the survey area: the error that is to be expected
    found: Float[np.ndarray, " k"]  # share of the true high-interest area that is predicted; NaN where there is none


def frame_times(report: SurveyReport) -> Float[np.ndarray, " k"]:
    """Instants from 0 to the end at a round step in the unit that is shown, the end itself always among them."""
    end = report.episode.end
    if not end > 0:
        return np.zeros(1)
    factor = time_unit(report).factor
    step = nice_step(end * factor, MOST_FRAMES - 1) / factor
    times = step * np.arange(np.ceil(end / step))
    return np.append(times[times < end - 1e-3 * step], end)


def frames_of(report: SurveyReport, grid: MapGrid) -> Frames:
    """The frames of a report, with pictures on this grid."""
    episode, scenario = report.episode, report.episode.scenario
    times, geo = frame_times(report), report.geo
    instants = times + time_tolerance(np.asarray(scenario.speeds))  # what is measured at an instant is in its frame
    belief, inside = episode.beliefs(instants), episode.inside
    traces, points = np.asarray(belief.trace, np.float64), max(int(inside.sum()), 1)
    area = area_found(episode.truth >= scenario.threshold, belief.area, inside)
    unknown = np.full(len(times), np.nan)
    variance = np.maximum(np.asarray(belief.variance, np.float64)[:, inside], 0.0)
    error = (np.asarray(belief.mean, np.float64) - episode.truth)[:, inside]
    return Frames(
        times=times,
        mean=grid.pictures(geo.to_user_values(belief.mean)),
        std=grid.pictures(geo.to_user_std(np.sqrt(np.maximum(belief.variance, 0.0)))),
        surplus=grid.pictures(episode.surplus(belief.bound)),
        trace=traces,
        area=np.asarray(area.predicted),
        spread=geo.to_user_std(np.sqrt(traces / np.maximum(belief.area.sum(axis=1), 1))),
        rmse=geo.to_user_std(np.sqrt((error**2).sum(axis=1) / points)) if report.truth_known else unknown,
        expected_error=geo.to_user_std(np.sqrt(variance.sum(axis=1) / points)),
        found=np.asarray(area.both / area.true) if report.truth_known and area.true.all() else unknown,
    )


def standing(told: tuple[Broadcast, ...], agents: int, times: Float[np.ndarray, " k"]) -> Int[np.ndarray, "k m"]:
    """For every instant and robot, the index of what it told last by then; -1 where it has told nothing."""
    index = np.full((len(times), agents), -1)
    for number in sorted(range(len(told)), key=lambda i: told[i].time):
        index[times >= told[number].time - 1e-9, told[number].agent] = number
    return index
