"""A table as a picture: what each row leaves at each budget, the paper's numbers hollow beside ours."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maipp.bench.cells import Line
from maipp.bench.drawings import log_scale, put_title
from maipp.bench.evaluate import summarise
from maipp.bench.page import METRICS
from maipp.bench.tables import TableSpec
from maipp.viz.style import AGENT_COLOURS, GREY, MEDIUM, SMALL, add_axes, new_figure

_LEFT, _WIDTH, _GAP, _RIGHT, _TOP, _BOTTOM, _LINE = 1.6, 3.6, 0.2, 0.2, 0.75, 0.75, 0.24  # inches


def draw_table(table: TableSpec, lines: Sequence[Line]) -> Figure:
    """One panel per part, one line per row, one colour per budget; bars are standard errors over instances."""
    names = list(dict.fromkeys(line.row.name for line in lines))
    parts = [part for part in table.parts if any(line.part is part for line in lines)]
    height = _LINE * max(len(names), 4)
    figure = new_figure(_LEFT + len(parts) * (_WIDTH + _GAP) - _GAP + _RIGHT, _BOTTOM + height + _TOP, dpi=160)
    panels = []
    for number, part in enumerate(parts):
        axes = add_axes(figure, _LEFT + number * (_WIDTH + _GAP), _BOTTOM, _WIDTH, height)
        for line in lines:
            if line.part is part:
                _draw_line(axes, table, line, names.index(line.row.name))
        if len(parts) > 1:
            reach = part.scenario.comm_range
            axes.set_title("global" if reach is None else f"range {reach:g}", fontsize=MEDIUM, loc="left", pad=4)
        log_scale(axes, "x")
        axes.set_xlabel(METRICS[table.metric], fontsize=SMALL)
        axes.set(ylim=(len(names) - 0.5, -0.5), yticks=range(len(names)))
        axes.set_yticklabels(names if number == 0 else [], fontsize=SMALL)
        axes.grid(axis="both", which="major", linewidth=0.3, alpha=0.5)
        axes.set_axisbelow(True)
        panels.append(axes)
    limits = [axes.get_xlim() for axes in panels]
    for axes in panels:
        axes.set_xlim(min(low for low, _ in limits), max(high for _, high in limits))
    put_title(figure, table.title, _LEFT, 0.15)
    width, whole = figure.get_size_inches()
    figure.legend(
        handles=_legend(table), loc="lower left", bbox_to_anchor=(_LEFT / width, 0.08 / whole), ncols=6,
        fontsize=SMALL, frameon=False, borderaxespad=0.0, columnspacing=1.2, handlelength=1.0,
    )  # fmt: skip
    return figure


def _draw_line(axes: Axes, table: TableSpec, line: Line, place: int) -> None:
    printed = line.part.printed.get(line.row.paper or "", {})
    for number, column in enumerate(table.columns):
        colour = AGENT_COLOURS[number]
        summary = summarise(line.results[column].values[table.metric])
        axes.errorbar(
            summary.mean, place, xerr=summary.se, color=colour, marker="o", ms=4.0, mec="white", mew=0.4, lw=1.0
        )
        if column in printed:
            axes.plot(printed[column].mean, place, ls="", marker="D", ms=4.5, mfc="none", mec=colour, mew=1.0)


def _legend(table: TableSpec) -> list[Line2D]:
    entries = [
        Line2D([], [], ls="", marker="o", ms=4.5, color=AGENT_COLOURS[number], label=table.heading(column))
        for number, column in enumerate(table.columns)
    ]
    return [*entries, Line2D([], [], ls="", marker="D", ms=4.5, mfc="none", mec=GREY, label="the paper's")]
