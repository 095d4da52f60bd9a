"""The planned survey in one picture: what is expected, and how uncertain it is before and after, with the routes."""

import numpy as np
from matplotlib.figure import Figure

from maipp.engine.episode import Episode
from maipp.surveys.standardise import PreparedSurvey
from maipp.viz.maps import colour_bar, draw_field, draw_routes, legend_below, legend_of, map_size, prepare_map
from maipp.viz.style import STD_MAP, VALUE_MAP, add_axes, heading, new_figure

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.75, 0.75, 0.85, 0.95  # margins, inches
_GAP, _BAR_GAP, _BAR, _AFTER_BAR = 0.25, 0.1, 0.14, 1.0


def draw_plan(prepared: PreparedSurvey, episode: Episode, dpi: int = 160) -> Figure:
    """Three maps in the user's coordinates and unit: expected values, uncertainty before the survey and after it."""
    there = episode.drawn
    # Before the first measurement, and after the last.
    belief = episode.beliefs(np.array([-1.0, np.inf]))
    mean = there.to_user_values(belief.mean[1])
    before, after = there.to_user_std(np.sqrt(np.maximum(belief.variance, 0.0)))
    width, height = map_size(episode, area=9.0, longest=4.5)
    lefts = [_LEFT, _LEFT + width + _BAR_GAP + _BAR + _AFTER_BAR]
    lefts.append(lefts[1] + width + _GAP)
    total = lefts[2] + width + _BAR_GAP + _BAR + _RIGHT
    figure = new_figure(total, _BOTTOM + height + _TOP, dpi)
    inside = episode.inside
    low, high = float(mean[inside].min()), float(mean[inside].max())
    flat = max(prepared.frame.std, 1e-9) * (high - low < 1e-6 * prepared.frame.std)
    most = float(before[inside].max())
    rows = (
        (f"Expected {prepared.survey.quantity or 'values'}", mean, VALUE_MAP, (low - flat, high + flat)),
        ("Uncertainty before the survey (std)", before, STD_MAP, (0.0, most)),
        ("Uncertainty after it (std)", after, STD_MAP, (0.0, most)),
    )
    for index, (title, values, colours, limits) in enumerate(rows):
        axes = add_axes(figure, lefts[index], _BOTTOM, width, height)
        image = draw_field(axes, episode, values, colours, limits)
        prepare_map(axes, episode, title, y_label=index == 0)
        if index != 1:
            draw_routes(axes, episode)
            bar = add_axes(figure, lefts[index] + width + _BAR_GAP, _BOTTOM, _BAR, height)
            mark = prepared.survey.threshold if index == 0 else None
            colour_bar(figure, bar, image, there.value_name if index == 0 else f"std of {there.value_name}", mark)
    count = sum(len(agent.measurement_y) for agent in episode.agents)
    team = f"{len(prepared.names)} robot{'s' if len(prepared.names) > 1 else ''}"
    line = f"{episode.planner}, {team}, {count} measurements, as expected: measured values will change the routes"
    heading(figure, _LEFT, prepared.survey.name, line)
    entries = legend_of(episode)
    for entry, name in zip(entries, prepared.names, strict=False):
        entry.set_label(name)
    legend_below(figure, entries, _LEFT)
    return figure
