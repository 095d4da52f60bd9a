"""One look for every picture: colours that colour-blind readers can tell apart, thin frames, small type."""

import os

from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from maipp.files import atomic_path

# Okabe & Ito 2008, without the yellow that vanishes on bright maps; black comes last.
AGENT_COLOURS = ("#D55E00", "#56B4E9", "#CC79A7", "#009E73", "#E69F00", "#0072B2", "#000000")
_LINE_STYLES = ("-", (0, (5, 1.5)), (0, (1, 1)))

VALUE_MAP, STD_MAP = "viridis", "Purples"
AREA_COLOUR, OUTLINE_COLOUR, OBSTACLE_COLOUR, GREY = "#BFD3E6", "#1A1A1A", "#6E6E6E", "#555555"

SMALL, MEDIUM, LARGE = 7.5, 9.0, 11.0  # points


def agent_colour(agent: int) -> str:
    """Colour of an agent, the same in every picture."""
    return AGENT_COLOURS[agent % len(AGENT_COLOURS)]


def agent_line(agent: int) -> str | tuple:
    """Line style of an agent: teams larger than the palette meet each colour again, but dashed."""
    return _LINE_STYLES[agent // len(AGENT_COLOURS) % len(_LINE_STYLES)]


def halo(width: float) -> list[patheffects.AbstractPathEffect]:
    """A white border of this width (points) around a line, so that it shows on any map."""
    return [patheffects.Stroke(linewidth=width, foreground="white"), patheffects.Normal()]


def new_figure(width: float, height: float, dpi: int) -> Figure:
    """An empty white figure (inches), drawn without any global state of pyplot."""
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def heading(figure: Figure, left: float, title: str, line: str) -> None:
    """Add the title and a line below it at the upper left corner, `left` inches from the border."""
    width, height = figure.get_size_inches()
    figure.text(left / width, 1 - 0.18 / height, title, fontsize=LARGE, weight="bold", va="top")
    figure.text(left / width, 1 - 0.42 / height, line, fontsize=MEDIUM, color=GREY, va="top")


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write the figure into a picture file. Raises `InputError` where it cannot be written."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary)


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at this place (inches from the lower left corner), in the house's look."""
    whole_width, whole_height = figure.get_size_inches()
    axes = figure.add_axes((left / whole_width, bottom / whole_height, width / whole_width, height / whole_height))
    axes.tick_params(labelsize=SMALL, width=0.6, length=2.5, color=GREY)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)
        spine.set_color(GREY)
    return axes


def bare_axes(figure: Figure, like: Axes) -> Axes:
    """Transparent axes without ticks and labels, at the place and with the limits and scales of others."""
    axes = figure.add_axes(like.get_position(original=True).bounds)
    axes.set(xscale=like.get_xscale(), yscale=like.get_yscale(), xlim=like.get_xlim(), ylim=like.get_ylim())
    axes.set_aspect(like.get_aspect())
    axes.set_autoscale_on(False)
    axes.patch.set_visible(False)
    axes.xaxis.set_visible(False)
    axes.yaxis.set_visible(False)
    for name, spine in axes.spines.items():
        other = like.spines[name]
        spine.set(linewidth=other.get_linewidth(), color=other.get_edgecolor(), visible=other.get_visible())
    return axes
