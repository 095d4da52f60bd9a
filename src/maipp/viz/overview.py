"""The survey in one picture: truth, predicted mean, high-interest area, predicted std, with the routes on them."""

import os

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from maipp.engine.episode import Episode
from maipp.viz.captions import headline, numbers_line
from maipp.viz.maps import (
    area_outline,
    colour_bar,
    draw_field,
    draw_routes,
    legend_below,
    legend_of,
    map_size,
    prepare_map,
)
from maipp.viz.style import (
    AREA_COLOUR,
    OUTLINE_COLOUR,
    SMALL,
    STD_MAP,
    VALUE_MAP,
    add_axes,
    heading,
    new_figure,
    save_figure,
)

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.65, 0.75, 0.85, 0.85  # margins, inches
_GAP_X, _GAP_Y, _BAR_GAP, _BAR = 0.25, 0.45, 0.12, 0.14


def draw_overview(episode: Episode, dpi: int = 160) -> Figure:
    """The four maps of Yang et al. 2023, Fig. 1, in the file's coordinates and units where there are any."""
    there, scenario = episode.drawn, episode.scenario
    belief = episode.beliefs(np.array([np.inf]))
    truth, mean = there.to_user_values(episode.truth), there.to_user_values(belief.mean[0])
    std = there.to_user_std(np.sqrt(belief.variance[0]))
    shown = np.concatenate([truth[episode.inside], mean[episode.inside]])
    limits = (float(shown.min()), float(shown.max()))

    width, height = map_size(episode, area=9.0, longest=4.5)
    figure = new_figure(
        _LEFT + 2 * width + _GAP_X + _BAR_GAP + _BAR + _RIGHT, _BOTTOM + 2 * height + _GAP_Y + _TOP, dpi
    )
    right, up = _LEFT + width + _GAP_X, _BOTTOM + height + _GAP_Y
    bar_left = right + width + _BAR_GAP

    axes = add_axes(figure, _LEFT, up, width, height)
    draw_field(axes, episode, truth, VALUE_MAP, limits)
    prepare_map(axes, episode, "Ground truth", x_label=False)
    draw_routes(axes, episode)

    axes = add_axes(figure, right, up, width, height)
    image = draw_field(axes, episode, mean, VALUE_MAP, limits)
    prepare_map(axes, episode, "Predicted mean", x_label=False, y_label=False)
    draw_routes(axes, episode)
    threshold = float(there.to_user_values(scenario.threshold))
    colour_bar(figure, add_axes(figure, bar_left, up, _BAR, height), image, there.value_name, threshold)

    axes = add_axes(figure, _LEFT, _BOTTOM, width, height)
    prepare_map(axes, episode, "High-interest area")
    area_outline(axes, episode, episode.surplus(belief.bound[0]), filled=True)
    area_outline(axes, episode, episode.truth - scenario.threshold)
    draw_routes(axes, episode)
    axes.legend(
        handles=[
            Patch(color=AREA_COLOUR, label="predicted"),
            Line2D([], [], color=OUTLINE_COLOUR, lw=1.0, label="true"),
        ],
        fontsize=SMALL,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=2,
        frameon=False,
        borderaxespad=0.1,
        handlelength=1.4,
        columnspacing=1.0,
    )

    axes = add_axes(figure, right, _BOTTOM, width, height)
    image = draw_field(axes, episode, std, STD_MAP, (0.0, float(std[episode.inside].max())))
    prepare_map(axes, episode, "Predicted standard deviation", y_label=False)
    draw_routes(axes, episode)
    colour_bar(figure, add_axes(figure, bar_left, _BOTTOM, _BAR, height), image, f"std of {there.value_name}")

    heading(figure, _LEFT, headline(episode), numbers_line(episode))
    legend_below(figure, legend_of(episode), _LEFT)
    return figure


def save_overview(episode: Episode, path: str | os.PathLike[str]) -> None:
    """Draw the overview into a picture file. Raises `InputError` where it cannot be written."""
    save_figure(draw_overview(episode), path)
