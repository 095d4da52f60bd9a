"""The data of a report's page: plain lists and numbers in the user's units, few digits, ready for JSON."""

import base64
import math
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from maipp.team.broadcast import Broadcast
from maipp.typing import Float
from maipp.viz.report_frames import Frames, standing
from maipp.viz.report_grid import MapGrid
from maipp.viz.report_survey import SurveyReport
from maipp.viz.report_units import decimals, length_unit, time_unit
from maipp.viz.style import STD_MAP, VALUE_MAP, agent_colour, agent_line

_DASHES = {"-": "solid", (0, (5, 1.5)): "dash", (0, (1, 1)): "dot"}
_HALF = 1 << 15
_ELLIPSE = np.linspace(0.0, 2 * np.pi, 33)
_MARGIN = 0.015  # of an area's width around it, so that no robot is cut off at its border
INTENT_SHARE = 0.9  # of an intent's probability within the ellipse that is drawn
_RADIUS = math.sqrt(-2 * math.log(1 - INTENT_SHARE))  # of that ellipse, standard deviations


def page_data(report: SurveyReport, grid: MapGrid, frames: Frames) -> dict[str, Any]:
    """Everything that the page's maps and curves draw."""
    episode = report.episode
    low, high = np.array([grid.x[0], grid.y[0]]), np.array([grid.x[-1], grid.y[-1]])
    digits = decimals(float((high - low).max()), 6)
    length, time = length_unit(report), time_unit(report)
    truth = grid.pictures(report.geo.to_user_values(episode.truth)[None])[0] if report.truth_known else None
    surplus = grid.pictures(episode.surplus(episode.truth)[None])
    return {
        "axes": _axes(report, low, high),
        "grid": {"x": _spaced(grid.x), "y": _spaced(grid.y), "columns": len(grid.x), "rows": len(grid.y)},
        "value": {"name": report.geo.quantity, "unit": report.geo.unit or "", "threshold": _real(report.threshold)},
        "length": length.name,
        "time": {"unit": time.name, "step": time_decimals(frames, time.factor)},
        "colours": {"value": _stops(VALUE_MAP), "std": _stops(STD_MAP)},
        "limits": {"value": _value_limits(report, frames, truth), "std": [0.0, _real(np.nanmax(frames.std)) or 1.0]},
        "frames": {
            "time": [_real(t * time.factor) for t in frames.times],
            "mean": packed(frames.mean),
            "std": packed(frames.std),
            "surplus": packed(frames.surplus, signed=True),
            **{name: _reals(getattr(frames, name)) for name in ("trace", "area", "rmse")},
        },
        "truth": None if truth is None else packed(truth[None]),
        "foreseen": None if report.foreseen is None else _foreseen(report, grid),
        "true_surplus": None if truth is None else packed(surplus, signed=True),
        "curve": {
            "time": _reals(episode.metrics.curve_time * time.factor),
            "trace": _reals(episode.metrics.curve_trace),
            "distance": _reals(_travelled(report, episode.metrics.curve_time) * length.factor),
        },
        "robots": [_robot(report, index, digits, time.factor) for index in range(len(episode.agents))],
        "area": _places(report.outline, digits),
        "no_go": [_places(np.asarray(ring), digits) for ring in report.rings],
        "prior": None
        if report.prior is None
        else {**_places(report.prior[0], digits), "value": _reals(report.prior[1])},
        "told": [_told(report, told, digits, time.factor) for told in report.broadcasts],
        "standing": standing(report.broadcasts, len(episode.agents), frames.times).tolist()
        if report.broadcasts
        else None,
    }


def time_decimals(frames: Frames, factor: float) -> int:
    """Decimals that tell the instants of the slider apart."""
    return decimals(float(frames.times[1] - frames.times[0]) * factor, 1) if len(frames.times) > 2 else 2


def packed(pictures: Float[np.ndarray, "k r c"], *, signed: bool = False) -> dict[str, Any]:
    """Pictures as 16-bit numbers in base64: value = base + step * number, and 65535 for NaN.

    `signed` keeps the sign of every value, as a contour at 0 needs it: numbers below 0 stay below, 0 and more do not.
    """
    known = pictures[np.isfinite(pictures)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    if signed:
        step = max(-low, high, 1e-9) / (_HALF - 2)
        numbers = np.floor(pictures / step)
        base, numbers = -_HALF * step, np.where(pictures < 0, np.minimum(numbers, -1.0), numbers) + _HALF
    else:
        step = (high - low) / (2 * _HALF - 2) or 1.0
        base, numbers = low, np.round((pictures - low) / step)
    whole = np.where(np.isfinite(numbers), numbers, 2 * _HALF - 1).astype("<u2")
    return {"base": base, "step": step, "numbers": base64.b64encode(whole.tobytes()).decode("ascii")}


def _foreseen(report: SurveyReport, grid: MapGrid) -> dict[str, Any]:
    """The map of a foresight."""
    assert report.foreseen is not None
    name, mean, std = report.foreseen
    std_pictures = grid.pictures(report.geo.to_user_std(std)[None])
    return {
        "name": name,
        "mean": packed(grid.pictures(report.geo.to_user_values(mean)[None])),
        "surplus": packed(grid.pictures((mean - report.episode.scenario.threshold)[None]), signed=True),
        "std": packed(std_pictures),
        "std_limits": [0.0, _real(np.nanmax(std_pictures)) or 1.0],
    }


def _axes(report: SurveyReport, low: np.ndarray, high: np.ndarray) -> dict[str, Any]:
    """Labels, proportions and limits of every map."""
    outline = report.outline
    near, far = outline.min(axis=0), outline.max(axis=0)
    margin = _MARGIN * (far - near)
    shown = (*near - margin, *far + margin)
    return {
        "x": report.x_label,
        "y": report.y_label,
        "aspect": _real(report.geo.for_pictures.aspect),
        "shown": [_real(value, 9) for value in shown],
        "whole": [_real(value, 9) for value in (*low, *high)],
        "decimals": decimals(float((far - near).max()), 4),
    }


def _robot(report: SurveyReport, index: int, digits: int, per_time: float) -> dict[str, Any]:
    agent = report.episode.agents[index]
    return {
        "name": report.robots[index],
        "colour": agent_colour(index),
        "dash": _DASHES[agent_line(index)],
        "route": {**_places(report.geo.to_user(agent.route), digits), "time": _reals(agent.route_time * per_time)},
        "measured": {
            **_places(report.geo.to_user(agent.measurement_x), digits),
            "time": _reals(agent.measurement_time * per_time),
            "value": _reals(report.geo.to_user_values(agent.measurement_y)),
        },
    }


def _told(report: SurveyReport, told: Broadcast, digits: int, per_time: float) -> dict[str, Any]:
    """An intent as the ellipse that holds most of it, and the places announced with their times."""
    ellipse = None
    if np.isfinite(told.mean).all() and np.isfinite(told.covariance).all():
        xx, xy, yy = np.asarray(told.covariance, np.float64)
        root = np.linalg.cholesky(np.array([[xx, xy], [xy, yy]]))
        circle = np.stack([np.cos(_ELLIPSE), np.sin(_ELLIPSE)], axis=-1)
        ellipse = _places(report.geo.to_user(told.mean + _RADIUS * circle @ root.T), digits)
    future = np.isfinite(told.place_times)
    places = _places(report.geo.to_user(told.places[future]), digits)
    return {"ellipse": ellipse, "places": {**places, "time": _reals(told.place_times[future] * per_time)}}


def _travelled(report: SurveyReport, times: np.ndarray) -> np.ndarray:
    """Path travelled by the team at these times, domain units."""
    total = np.zeros(len(times))
    for agent in report.episode.agents:
        steps = np.linalg.norm(np.diff(agent.route, axis=0), axis=1)
        total += np.interp(times, agent.route_time, np.append(0.0, np.cumsum(steps)))
    return total


def _value_limits(report: SurveyReport, frames: Frames, truth: np.ndarray | None) -> list[float | None]:
    """Ends of the colour scale of values: those of the truth, of the maps at the end, and of earlier samples."""
    shown = [frames.mean[-1].ravel(), *([] if truth is None else [truth.ravel()])]
    if report.foreseen is not None:
        shown.append(np.asarray(report.geo.to_user_values(report.foreseen.mean)))
    if report.prior is not None:
        shown.append(report.prior[1])
    values = np.concatenate(shown)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    # Rounding of a mean that is the same everywhere must not look like a pattern.
    prior_std = float(report.geo.to_user_std(report.episode.scenario.signal_variance**0.5))
    if high - low > 1e-3 * prior_std:
        return [_real(low), _real(high)]
    return [_real(min(low, report.threshold) - prior_std), _real(max(high, report.threshold) + prior_std)]


def _stops(name: str) -> list[str]:
    """A colour map as evenly spaced colours."""
    return [to_hex(colour) for colour in colormaps[name](np.linspace(0.0, 1.0, 17))]


def _spaced(line: np.ndarray) -> list[float | None]:
    """First value and step of evenly spaced ones."""
    return [_real(line[0], 12), _real((line[-1] - line[0]) / (len(line) - 1), 12)]


def _places(points: np.ndarray, digits: int) -> dict[str, list[float]]:
    rounded = np.round(np.asarray(points, np.float64), digits)
    return {"x": rounded[:, 0].tolist(), "y": rounded[:, 1].tolist()}


def _reals(values: Any, digits: int = 5) -> list[float | None]:
    return [_real(value, digits) for value in np.asarray(values, np.float64).tolist()]


def _real(value: Any, digits: int = 6) -> float | None:
    """With so many significant digits; None where it is not finite."""
    value = float(value)
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None
