"""What the pictures of benchmarks have in common, beyond the look of `maipp.viz`."""

from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maipp.files import atomic_path
from maipp.viz.style import LARGE, SMALL


def log_scale(axes: Axes, which: Literal["x", "y"]) -> None:
    """Make an axis logarithmic, with plain numbers at 1, 2 and 5."""
    axes.set(**{f"{which}scale": "log"})
    axis = axes.xaxis if which == "x" else axes.yaxis
    for axis_format in (axis.set_major_formatter, axis.set_minor_formatter):
        axis_format(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "125" else "")
    axes.tick_params(which="both", labelsize=SMALL)


def put_title(figure: Figure, title: str, left: float, top: float) -> None:
    """A title, its corner at this place (inches from the upper left one)."""
    width, height = figure.get_size_inches()
    figure.text(left / width, 1 - top / height, title, fontsize=LARGE, weight="bold", va="top")


def save_figure(figure: Figure, path: Path) -> None:
    """Write a picture, whole or not at all. Raises `InputError` where it cannot be written."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary)
