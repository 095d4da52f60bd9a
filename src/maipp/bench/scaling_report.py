"""What `maipp benchmark scaling` leaves: a JSON file with everything, two CSV files, a page of tables, a figure."""

import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from maipp.bench.belief_error import BeliefError
from maipp.bench.drawings import save_figure
from maipp.bench.made_by import machine, versions
from maipp.bench.output import csv_text
from maipp.bench.page import made_on
from maipp.bench.scaling import AXES, BASE, Cost, growth
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.markdown import markdown_table
from maipp.viz.style import AGENT_COLOURS, GREY, MEDIUM, SMALL, add_axes, new_figure

LIMIT_MS = 250.0  # a decision at the largest size should take less

_LABELS = {"agents": "agents", "measurements": "measurements", "grid": "grid points per side", "nodes": "roadmap nodes"}
_WIDTH, _HEIGHT, _LEFT, _BOTTOM, _GAP_X, _GAP_Y = 1.9, 1.7, 0.6, 0.55, 0.35, 0.3  # inches


class Results(NamedTuple):
    """What has been measured, and with which settings."""

    settings: dict[str, Any]
    costs: list[Cost]
    errors: list[BeliefError]


def write_json(results: Results, folder: Path) -> None:
    """Write all results so far to `scaling.json`; JSON has no NaN, which becomes null."""
    content = {
        "settings": results.settings,
        "versions": versions(),
        "machine": machine(),
        "costs": [cost._asdict() for cost in results.costs],
        "growth": [line._asdict() for line in growth(results.costs)],
        "errors": [_replaced(error._asdict(), math.isnan, None) for error in results.errors],
    }
    write_atomic(folder / "scaling.json", json.dumps(content, indent=1, allow_nan=False) + "\n")


def read_json(folder: Path, settings: dict[str, Any]) -> Results:
    """The results that `folder` holds of a run with the same settings, versions and machine; else none.

    Raises `InputError` for a file that is no such record.
    """
    path = folder / "scaling.json"
    none = Results(settings, [], [])
    if not path.exists():
        return none
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        here = (settings, versions(), machine())
        if tuple(content[key] for key in ("settings", "versions", "machine")) != here:
            return none
        costs = [Cost(**row) for row in content["costs"]]
        errors = [BeliefError(**_replaced(row, lambda value: value is None, math.nan)) for row in content["errors"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: not a record of this benchmark ({error}); remove it, or give another --out"
        ) from None
    return Results(settings, costs, errors)


def _replaced(row: dict[str, Any], which: Callable[[Any], bool], by: Any) -> dict[str, Any]:
    return {key: by if which(value) else value for key, value in row.items()}


def add_missing(
    kept: list[Any], wanted: Iterable[tuple], measure: Callable[..., Any], told: Callable[[Any], None]
) -> None:
    """Measure at all points of which nothing is kept yet, and keep what comes; `told` hears of each when it is kept."""
    there = {one.point for one in kept}
    for point in wanted:
        if point not in there:
            kept.append(measure(*point))
            told(kept[-1])


def write_report(results: Results, folder: Path) -> list[Path]:
    """Write tables and figure of finished results; gives the paths written."""
    written = [folder / name for name in ("scaling.json", "scaling.csv", "errors.csv", "scaling.md", "scaling.png")]
    write_json(results, folder)
    write_atomic(written[1], csv_text(Cost._fields, results.costs))
    write_atomic(written[2], csv_text(BeliefError._fields, results.errors))
    write_atomic(written[3], to_markdown(results))
    save_figure(draw_scaling(results.costs), written[4])
    return written


def to_markdown(results: Results) -> str:
    """The tables: exponents, the largest size, every point, and the errors of the belief."""
    grown = ((f"`{g.planner}`", g.axis, *(f"{value:.2f}" for value in g[2:])) for g in growth(results.costs))
    costs = ((f"`{c.planner}`", *map(str, c[1:6]), *(f"{c[i]:.1f}" for i in (6, 7, 9, 10, 11))) for c in results.costs)
    errors = (
        (
            *(f"{value:g}" for value in e[:4]),
            f"{e.trace:.4g}",
            *(f"{100 * value:.3f} %" for value in (e.error, e.error_se, e.error_worst)),
            *(f"{value:.2g}" for value in (e.mean_worst, e.variance_worst)),
        )
        for e in results.errors
    )
    parts = [
        "# Scaling",
        f"{made_on((machine(), versions()))}. Times are processor time of one decision (hear, observe, decide), "
        "medians; memory is what the compiled decision needs at its peak.",
        "Cost goes as the size to the power of:",
        markdown_table(("planner", "axis", "time", "time, last two sizes", "memory"), grown),
        "Every size:",
        markdown_table(("planner", "varied", *BASE, "ms", "p95", "compile s", "MB", "state MB"), costs),
    ]
    if results.errors:
        kinds = ("measurements", "interval", "length scale", "surveys")
        parts += [
            "Error of the belief against the exact one in float64 (se: over surveys; worst: of any survey; mean and "
            "variance: the worst of any survey and grid point):",
            markdown_table((*kinds, "Tr(P)", "error", "se", "worst", "mean", "variance"), errors),
        ]
    return "\n\n".join(parts) + "\n"


def draw_scaling(costs: Sequence[Cost], dpi: int = 160) -> Figure:
    """Time above, memory below, one panel for each axis, logarithmic; the dashed line is the limit of a decision."""
    axes_names = [axis for axis in AXES if any(cost.axis == axis for cost in costs)]
    planners = list(dict.fromkeys(cost.planner for cost in costs))
    width = _LEFT + max(1, len(axes_names)) * (_WIDTH + _GAP_X)
    figure = new_figure(width, 2 * _HEIGHT + _GAP_Y + _BOTTOM + 0.45, dpi)
    for column, axis in enumerate(axes_names):
        sizes = sorted({getattr(cost, axis) for cost in costs if cost.axis == axis})
        for row, (field, label) in enumerate((("memory_mb", "memory, MB"), ("decision_ms", "decision, ms"))):
            left, bottom = _LEFT + column * (_WIDTH + _GAP_X), _BOTTOM + row * (_HEIGHT + _GAP_Y)
            panel = add_axes(figure, left, bottom, _WIDTH, _HEIGHT)
            for i, name in enumerate(planners):
                line = sorted((getattr(c, axis), getattr(c, field)) for c in costs if c.point[:2] == (name, axis))
                look = {"color": AGENT_COLOURS[i % 7], "marker": "o", "ms": 2.5, "lw": 1}
                if line:
                    panel.plot(*zip(*line, strict=True), label=name, **look)
            panel.set(xscale="log", yscale="log")
            panel.set_xticks(sizes, [str(size) for size in sizes])
            panel.minorticks_off()
            if row:
                panel.axhline(LIMIT_MS, color=GREY, lw=0.6, ls="--")
            else:
                panel.set_xlabel(_LABELS[axis], fontsize=MEDIUM)
            if not column:
                panel.set_ylabel(label, fontsize=MEDIUM)
            if row and not column:
                lines = panel.get_legend_handles_labels()
                figure.legend(*lines, loc="upper center", ncols=3, fontsize=SMALL, frameon=False)
    return figure
