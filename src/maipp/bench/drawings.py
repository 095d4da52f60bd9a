"""The pictures of benchmarks, in the look of `maipp.viz`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maipp.bench.evaluate import summarise
from maipp.bench.intents import KINDS, SampledPaths, Stability
from maipp.bench.trace_curves import Curve
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


def draw_curves(curves: Sequence[Curve], title: str) -> Figure:
    """Mean Tr(P) over the distance of each agent; bands are the standard error over instances."""
    figure = new_figure(_LEFT + 5.0 + 2.1, _BOTTOM + 3.6 + _TOP, dpi=160)
    axes = add_axes(figure, _LEFT, _BOTTOM, 5.0, 3.6)
    for number, curve in enumerate(curves):
        mean = curve.trace.mean(axis=0)
        look = {"color": agent_colour(number), "ls": agent_line(number)}
        axes.plot(curve.distance, mean, lw=1.2, label=curve.row.name, **look)
        if len(curve.trace) > 1:
            error = curve.trace.std(axis=0, ddof=1) / np.sqrt(len(curve.trace))
            axes.fill_between(curve.distance, mean - error, mean + error, color=look["color"], alpha=0.2, lw=0)
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
