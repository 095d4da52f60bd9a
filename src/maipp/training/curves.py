"""The learning curve of a run, from its log: what its missions end with, and the held-out worlds."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from maipp.files import atomic_path
from maipp.training.training_log import read_log
from maipp.viz.style import AGENT_COLOURS, GREY, LARGE, MEDIUM, SMALL, add_axes, new_figure

CURVE = "learning_curve.png"
_POINTS = 60  # of the curve: updates are pooled into so many groups at most
_LEFT, _BOTTOM, _WIDTH, _HEIGHT, _GAP, _TOP, _RIGHT = 0.65, 0.6, 3.4, 2.5, 0.3, 0.5, 0.2  # inches


def draw_learning_curve(out: Path, title: str) -> None:
    """Draw OUT/learning_curve.png: final Tr(P) against transitions and against wall time."""
    rows = read_log(out)
    updates = [row for row in rows if "evaluation" not in row]
    evaluations = [row for row in rows if "evaluation" in row]
    figure = new_figure(_LEFT + 2 * _WIDTH + _GAP + _RIGHT, _BOTTOM + _HEIGHT + _TOP, 160)
    left = add_axes(figure, _LEFT, _BOTTOM, _WIDTH, _HEIGHT)
    right = add_axes(figure, _LEFT + _WIDTH + _GAP, _BOTTOM, _WIDTH, _HEIGHT)
    for axes, key, scale, label in (
        (left, "transitions", 1.0, "decisions sampled"),
        (right, "wall_s", 1 / 60, "wall time (minutes)"),
    ):
        _draw(axes, updates, evaluations, key, scale)
        axes.set_xlabel(label, fontsize=MEDIUM)
        axes.set_yscale("log")
        for axis_format in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
            axis_format(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "1235" else "")
        axes.tick_params(which="both", labelsize=SMALL)
        axes.grid(axis="y", which="both", linewidth=0.3, alpha=0.5)
    right.set_ylim(left.get_ylim())
    right.tick_params(axis="y", which="both", labelleft=False)
    left.set_ylabel("final Tr(P)", fontsize=MEDIUM)
    if left.get_legend_handles_labels()[0]:
        left.legend(fontsize=SMALL, frameon=False)
    figure.suptitle(title, x=_LEFT / figure.get_size_inches()[0], ha="left", fontsize=LARGE)
    with atomic_path(out / CURVE) as path:
        figure.savefig(path)


def _draw(axes: Axes, updates: list[dict[str, Any]], evaluations: list[dict[str, Any]], key: str, scale: float) -> None:
    """The sampled missions as a line, the held-out worlds as points with their standard errors."""
    x, trace = _pooled(updates, key)
    if len(x):
        axes.plot(x * scale, trace, color=GREY, linewidth=1.2, label="while training, steps sampled")
    if evaluations:
        mean = np.array([row["evaluation"]["trace"] for row in evaluations], float)
        se = np.array([row["evaluation"]["se"] or 0.0 for row in evaluations], float)
        place = np.array([row[key] for row in evaluations], float) * scale
        colour = AGENT_COLOURS[0]
        axes.errorbar(
            place, mean, yerr=se, color=colour, fmt="o-", markersize=3, linewidth=0.8, label="held-out worlds (s.e.)"
        )


def _pooled(updates: list[dict[str, Any]], key: str) -> tuple[np.ndarray, np.ndarray]:
    """Where groups of updates end, and the mean final Tr(P) of the missions that ended in each."""
    ended = [row for row in updates if row.get("final_trace") is not None and row.get("missions_ended")]
    x, trace = [], []
    for group in np.array_split(np.arange(len(ended)), min(_POINTS, len(ended)) or 1):
        if len(group):
            weight = np.array([ended[i]["missions_ended"] for i in group], float)
            x.append(ended[group[-1]][key])
            trace.append(np.average([ended[i]["final_trace"] for i in group], weights=weight))
    return np.array(x, float), np.array(trace, float)
