"""The pictures of benchmarks, in the look of `maipp.viz`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import jax.numpy as jnp
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maipp.bench.evaluate import summarise
from maipp.bench.frame import grids, grouped
from maipp.bench.intents import KINDS, SampledPaths, Stability
from maipp.bench.page import METRICS
from maipp.bench.tables import TablePart, TableSpec
from maipp.files import atomic_path
from maipp.team import Intent, intent_density
from maipp.typing import Float
from maipp.viz.style import (
    AGENT_COLOURS,
    GREY,
    LARGE,
    MEDIUM,
    SMALL,
    add_axes,
    agent_colour,
    agent_line,
    halo,
    new_figure,
)


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


_LEFT, _BOTTOM, _RIGHT, _TOP, _GAP = 0.7, 0.6, 0.2, 0.6, 0.75  # inches
_FINE = 120  # points per side that a density is drawn on


def draw_table(table: TableSpec, frame: pd.DataFrame) -> Figure:
    """What each row leaves in each column of a table (`maipp.bench.frame`), the paper's numbers hollow beside ours.

    One panel per part, one line per row, one colour per column; bars are standard errors over instances.
    """
    names, parts = [*frame["row"].unique()], grouped(frame, "part")
    left, width, gap, right, top, bottom = 1.6, 3.6, 0.2, 0.2, 0.75, 0.75  # inches
    height = 0.24 * max(len(names), 4)
    figure = new_figure(left + len(parts) * (width + gap) - gap + right, bottom + height + top, dpi=160)
    for number, (which, missions) in enumerate(parts):
        part = table.parts[which]
        axes = add_axes(figure, left + number * (width + gap), bottom, width, height)
        _draw_part(axes, table, part, missions, names)
        if len(parts) > 1:
            reach = part.scenario.comm_range
            axes.set_title("global" if reach is None else f"range {reach:g}", fontsize=MEDIUM, loc="left", pad=4)
        log_scale(axes, "x")
        axes.set_xlabel(METRICS[table.metric], fontsize=SMALL)
        axes.set(ylim=(len(names) - 0.5, -0.5), yticks=range(len(names)))
        axes.set_yticklabels(names if number == 0 else [], fontsize=SMALL)
        axes.grid(axis="both", which="major", linewidth=0.3, alpha=0.5)
        axes.set_axisbelow(True)
    limits = [axes.get_xlim() for axes in figure.axes]
    for axes in figure.axes:
        axes.set_xlim(min(low for low, _ in limits), max(high for _, high in limits))
    put_title(figure, table.title, left, 0.15)
    across, whole = figure.get_size_inches()
    ours = [
        Line2D([], [], ls="", marker="o", ms=4.5, color=AGENT_COLOURS[number], label=table.heading(column))
        for number, column in enumerate(table.columns)
    ]
    paper = Line2D([], [], ls="", marker="D", ms=4.5, mfc="none", mec=GREY, label="the paper's")
    figure.legend(
        handles=[*ours, paper], loc="lower left", bbox_to_anchor=(left / across, 0.08 / whole), ncols=6,
        fontsize=SMALL, frameon=False, borderaxespad=0.0, columnspacing=1.2, handlelength=1.0,
    )  # fmt: skip
    return figure


def _draw_part(axes: Axes, table: TableSpec, part: TablePart, missions: pd.DataFrame, names: Sequence[str]) -> None:
    """The marks of all rows of a part."""
    paper = {row.name: part.printed.get(row.paper or "", {}) for row in table.rows}
    for (row, column), values in grids(missions, table.metric).items():
        summary, colour, place = summarise(values), AGENT_COLOURS[table.columns.index(column)], names.index(row)
        axes.errorbar(
            summary.mean, place, xerr=summary.se, color=colour, marker="o", ms=4.0, mec="white", mew=0.4, lw=1.0
        )
        if column in paper[row]:
            axes.plot(paper[row][column].mean, place, ls="", marker="D", ms=4.5, mfc="none", mec=colour, mew=1.0)


def draw_curves(curves: pd.DataFrame, title: str) -> Figure:
    """Mean Tr(P) over the distance of each agent (`trace_curve`); bands are the standard error over instances."""
    figure = new_figure(_LEFT + 5.0 + 2.1, _BOTTOM + 3.6 + _TOP, dpi=160)
    axes = add_axes(figure, _LEFT, _BOTTOM, 5.0, 3.6)
    for number, (row, curve) in enumerate(grouped(curves, "row")):
        traces = curve.pivot(index="instance", columns="distance", values="trace")
        distance, trace = traces.columns.to_numpy(), traces.to_numpy()
        mean = trace.mean(axis=0)
        look = {"color": agent_colour(number), "ls": agent_line(number)}
        axes.plot(distance, mean, lw=1.2, label=row, **look)
        if len(trace) > 1:
            error = trace.std(axis=0, ddof=1) / np.sqrt(len(trace))
            axes.fill_between(distance, mean - error, mean + error, color=look["color"], alpha=0.2, lw=0)
    log_scale(axes, "y")
    axes.grid(axis="y", which="major", linewidth=0.3, alpha=0.5)
    axes.set_xlabel("distance travelled by each agent", fontsize=MEDIUM)
    axes.set_ylabel("Tr(P)", fontsize=MEDIUM)
    axes.legend(fontsize=SMALL, frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    put_title(figure, title, _LEFT, 0.12)
    return figure


def draw_stability(found: Sequence[Stability], title: str) -> Figure:
    """Divergence of successive intents, and final Tr(P), over the length of the paths; bars are standard errors."""
    figure = new_figure(_LEFT + 2 * 2.8 + _GAP + _RIGHT, _BOTTOM + 2.5 + _TOP, dpi=160)
    for number, (label, values) in enumerate((("symmetric KL (nats)", "divergence"), ("final Tr(P)", "trace"))):
        axes = add_axes(figure, _LEFT + number * (2.8 + _GAP), _BOTTOM, 2.8, 2.5)
        for colour, kind in zip(AGENT_COLOURS, KINDS, strict=False):
            rows = [one for one in found if one.kind == kind]
            summaries = [summarise(getattr(one, values)) for one in rows]
            means, errors = [s.mean for s in summaries], [s.se or 0.0 for s in summaries]
            lengths = [one.length for one in rows]
            axes.errorbar(lengths, means, yerr=errors, color=colour, fmt="o-", ms=3.5, lw=1.0, label=kind)
        log_scale(axes, "y")
        axes.grid(axis="y", which="major", linewidth=0.3, alpha=0.5)
        axes.set_xlabel("nodes of a path (SGA+RRT: measurements)", fontsize=MEDIUM)
        axes.set_ylabel(label, fontsize=MEDIUM)
    figure.axes[0].legend(fontsize=SMALL, frameon=False)
    put_title(figure, title, _LEFT, 0.12)
    return figure


def draw_intents(sampled: SampledPaths, extent: tuple[float, float]) -> Figure:
    """Destination and trajectory intent of the same sampled paths (Yang et al. 2023, Fig. 3)."""
    width, height = 3.2 * extent[0] / max(extent), 3.2 * extent[1] / max(extent)
    figure = new_figure(_LEFT + 2 * width + 0.3 + _RIGHT, _BOTTOM / 2 + height + _TOP, dpi=160)
    for number, (name, intent) in enumerate(
        (("Destination intent", sampled.destination), ("Trajectory intent", sampled.trajectory))
    ):
        axes = add_axes(figure, _LEFT + number * (width + 0.3), _BOTTOM / 2, width, height)
        x, y = (np.linspace(0.0, side, _FINE) for side in extent)
        axes.contourf(x, y, _density(intent, x, y), levels=12, cmap="Blues", zorder=0)
        axes.plot(*sampled.nodes.T, ls="", marker=".", ms=2.0, color=GREY, alpha=0.6, zorder=1)
        for path, (points, taken) in enumerate(zip(sampled.paths, sampled.taken, strict=True)):
            if not taken.any():
                continue
            way, colour = np.concatenate([sampled.position[None], points[taken]]), agent_colour(path)
            axes.plot(
                *way.T, color=colour, ls=agent_line(path), lw=1.2, marker="o", ms=3.0, path_effects=halo(2.0), zorder=2
            )
            axes.plot(*way[-1], ls="", marker="s", ms=5.0, mfc=colour, mec="black", mew=0.6, zorder=3)
        axes.plot(*sampled.position, ls="", marker="*", ms=11, mfc="white", mec="black", mew=0.8, zorder=4)
        axes.set(xlim=(0, extent[0]), ylim=(0, extent[1]))
        axes.set_title(name, fontsize=MEDIUM, loc="left", pad=4)
        axes.tick_params(labelleft=number == 0)
    count, steps = sampled.taken.shape
    put_title(figure, f"{count} paths of {steps} nodes from one decision", _LEFT, 0.12)
    return figure


def _density(intent: Intent, x: Float[np.ndarray, " f"], y: Float[np.ndarray, " f"]) -> Float[np.ndarray, "f f"]:
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(intent.mean.dtype)
    return np.asarray(intent_density(Intent(*map(jnp.asarray, intent)), jnp.asarray(points))).reshape(len(y), len(x))


LIMIT_MS = 250.0  # a decision at the largest size should take less

_AXES = {"agents": "agents", "measurements": "measurements", "grid": "grid points per side", "nodes": "roadmap nodes"}
_COSTS = {"memory_mb": "memory, MB", "decision_ms": "decision, ms"}


def draw_scaling(costs: pd.DataFrame) -> Figure:
    """Time above, memory below, one panel for each axis, logarithmic; the dashed line is the limit of a decision.

    `costs` has the columns of `maipp.bench.scaling.Cost`.
    """
    varied = [axis for axis in _AXES if axis in {*costs["axis"]}]
    across, up, left, bottom = 1.9, 1.7, 0.6, 0.55  # inches
    figure = new_figure(left + max(1, len(varied)) * (across + 0.35), 2 * up + 0.3 + bottom + 0.45, dpi=160)
    for column, axis in enumerate(varied):
        there = costs.query("axis == @axis").sort_values(by=axis, kind="stable")
        sizes = sorted({*there[axis]})
        for row, (field, label) in enumerate(_COSTS.items()):
            panel = add_axes(figure, left + column * (across + 0.35), bottom + row * (up + 0.3), across, up)
            for i, name in enumerate(costs["planner"].unique()):
                line = there.query("planner == @name")
                look = {"color": AGENT_COLOURS[i % 7], "marker": "o", "ms": 2.5, "lw": 1}
                if len(line):
                    panel.plot([*line[axis]], [*line[field]], label=name, **look)
            panel.set(xscale="log", yscale="log")
            panel.set_xticks(sizes, [str(size) for size in sizes])
            panel.minorticks_off()
            if row:
                panel.axhline(LIMIT_MS, color=GREY, lw=0.6, ls="--")
            else:
                panel.set_xlabel(_AXES[axis], fontsize=MEDIUM)
            if not column:
                panel.set_ylabel(label, fontsize=MEDIUM)
            if row and not column:
                lines = panel.get_legend_handles_labels()
                figure.legend(*lines, loc="upper center", ncols=3, fontsize=SMALL, frameon=False)
    return figure
