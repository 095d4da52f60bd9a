"""The files that a table leaves: Markdown, whole and brief, with paired tests and what made it; CSV; a figure."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from maipp.bench.command import code, command, device_time, footer, made_on
from maipp.bench.drawings import draw_table, save_figure
from maipp.bench.evaluate import summarise
from maipp.bench.evaluations import Paired, paired
from maipp.bench.frame import TableResults, grids, grouped, read, wide
from maipp.bench.page import METRICS, markdown, shown
from maipp.bench.tables import SampleSize, TablePart, TableSpec, best
from maipp.bench.tidy_csv import compressed, missions_csv
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.markdown import mean_and_error
from maipp.typing import Float

BRIEF = "brief"  # folder of the short forms, for pages that have more to say than results


def write_table(table: TableSpec, folder: Path, sample: SampleSize, reference: str) -> list[Path]:
    """Write NAME.csv.gz, NAME.png, NAME.md and brief/NAME.md of all rows that the folder has every cell of.

    Gives their paths.
    Raises `InputError` where there is no such row, or a file cannot be written.
    """
    results = read(table, folder, sample)
    if not results.made:
        raise InputError(
            f"{folder}: no row of {table.name} has all its cells yet; run `maipp benchmark {table.typed or table.name}`"
        )
    csv, figure, page = (folder / f"{table.name}{suffix}" for suffix in (".csv.gz", ".png", ".md"))
    write_atomic(csv, compressed(missions_csv(results.missions)))
    save_figure(draw_table(table, results.missions), figure)
    text = table_page(table, results, sample, out=folder.name, reference=reference, files=(figure.name, csv.name))
    write_atomic(page, text)
    brief = folder / BRIEF / f"{table.name}.md"
    brief.parent.mkdir(exist_ok=True)
    write_atomic(brief, brief_page(table, results, sample, out=folder.name))
    return [csv, figure, page, brief]


def table_page(
    table: TableSpec, results: TableResults, sample: SampleSize, *, out: str, reference: str, files: Sequence[str] = ()
) -> str:
    """The whole page below its heading: one table per part and metric, paired tests, command, versions, wall time.

    `out` is the folder that the command is given, `reference` the row that others are paired with, `files` what lies
    beside the page.
    """
    blocks = [f"{table.title}."]
    for number, frame in grouped(results.missions, "part"):
        part = table.parts[number]
        blocks += [_heading(table.metric, part), _main(table, part, frame, sample), _half(table, part, frame)]
        blocks += _compared(table, part, frame, reference)
        for metric in table.beside:
            blocks += [_heading(metric, part), _by_column(table, _means(frame, metric))]
    blocks.append(_notes(table, results, sample))
    blocks += [f"![{table.title}]({name})" for name in files if name.endswith(".png")]
    blocks += [f"Every instance and trial: [{name}]({name})." for name in files if name.endswith(".csv.gz")]
    time = device_time(results.seconds, "the cells above")
    blocks += footer(_command(table, results, sample, out, reference), results.made, time)
    return "\n\n".join(block for block in blocks if block) + "\n"


def brief_page(table: TableSpec, results: TableResults, sample: SampleSize, *, out: str) -> str:
    """The short form: every row's number at every budget, how many missions they come from, and the command."""
    labels, blocks = {row.name: row.label for row in table.rows}, []
    for number, frame in grouped(results.missions, "part"):
        names = {row: labels[row] + _fewer(trials, sample) for row, trials in _trials(frame).items()}
        numbers = _by_column(table, _means(frame, table.metric), "planner", names.__getitem__)
        blocks += [_heading(table.metric, table.parts[number]), numbers]
    trials = f"{sample.trials} trial{'s' * (sample.trials > 1)}"
    blocks.append(
        f"Mean ± standard error over {sample.instances} instances of {trials} each, seed {sample.seed}, unless said; "
        f"lower is better. {made_on(*results.made)}"
    )
    blocks.append(code(_command(table, results, sample, out, table.reference)))
    return "\n\n".join(blocks) + "\n"


def _command(table: TableSpec, results: TableResults, sample: SampleSize, out: str, reference: str) -> str:
    """The command that fills the table with these rows."""
    quick = sample[:2] == table.quick_sample[:2] != table.sample[:2]
    flags = {"quick": quick, **sample._asdict(), "planners": [*results.missions["row"].unique()]}
    usual = {"quick": False, **(table.quick_sample if quick else table.sample)._asdict(), "reference": table.reference}
    usual["planners"] = [row.name for row in table.chosen(()) if row.quick or not quick]
    return command(table.typed or table.name, out, flags | {"reference": reference}, usual)


def _by_column(
    table: TableSpec,
    cells: Mapping[tuple[str, float], str],
    what: str = "row",
    name: Callable[[str], str] = lambda row: f"`{row}`",
) -> str:
    """A line for each row, and its columns."""
    page = wide(cells)
    page.columns = [table.heading(column) for column in page.columns]
    page.insert(0, what, [name(row) for row in page.index])
    return markdown(page)


def _means(frame: pd.DataFrame, metric: str) -> dict[tuple[str, float], str]:
    """What each cell has of a metric."""
    return {cell: shown(values) for cell, values in grids(frame, metric).items()}


def _main(table: TableSpec, part: TablePart, frame: pd.DataFrame, sample: SampleSize) -> str:
    """The paper's number and ours, column by column."""
    beside = bool(part.printed)  # there are numbers of the paper
    heading = ["row", "planner and options", *["in the paper"] * beside]
    for column in table.columns:
        heading += [*[f"{table.heading(column)}, paper"] * beside, table.heading(column)]
    rows, lines = {row.name: row for row in table.rows}, []
    values = grids(frame, table.metric)
    for name, trials in _trials(frame).items():
        row, printed = rows[name], part.printed.get(rows[name].paper or "", {})
        label = "" if row.label == f"`{name}`" else row.label
        line = [f"`{name}`{_fewer(trials, sample)}", label, *[row.paper if printed and row.paper else ""] * beside]
        for column in table.columns:
            if beside:
                line.append(f"{printed[column].mean:.2f} ({printed[column].std:.2f})" if column in printed else "")
            line.append(_with_deviation(values[name, column]))
        lines.append(line)
    return markdown(pd.DataFrame(lines, columns=heading), left=2 + beside)


def _with_deviation(values: Float[np.ndarray, "instances trials"]) -> str:
    """Mean and standard error over instances, and the paper's standard deviation."""
    std = summarise(values).std
    return shown(values) + ("" if std is None else f" ({f'{std:#.2g}'.rstrip('.')})")


def _half(table: TableSpec, part: TablePart, frame: pd.DataFrame) -> str:
    """Which rows are as good as the paper's best one, and which leave at most half of that."""
    if not part.printed:
        return ""
    lowest = np.array([best(part.printed, column) for column in table.columns])
    means = wide({cell: summarise(values).mean for cell, values in grids(frame, table.metric).items()})

    def within(share: float) -> str:
        """The rows at or below this share of the paper's best in every cell."""
        good = means.index[(means <= share * lowest).all(axis=1)]
        return ", ".join(f"`{name}`" for name in good) or "none"

    return (
        f"The paper's best: {', '.join(f'{least:.2f}' for least in lowest)}. At or below it at every budget: "
        f"{within(1.0)}. At or below half of it at every budget: {within(0.5)}."
    )


def _compared(table: TableSpec, part: TablePart, frame: pd.DataFrame, reference: str) -> list[str]:
    """The other rows minus the reference, on the same instances."""
    values = grids(frame, table.metric)
    pairs = {
        (row, column): paired(found, values[reference, column])
        for (row, column), found in values.items()
        if row != reference and (reference, column) in values
    }
    if not pairs:
        return []
    title = f"{METRICS[table.metric]} minus that of `{reference}` on the same instances, {_missions(part)}:"
    return [title, _by_column(table, {cell: _difference(test) for cell, test in pairs.items()})]


def _difference(test: Paired) -> str:
    """The difference with its sign, and its probability."""
    sign = "" if test.mean < 0 else "+"
    return sign + mean_and_error(test.mean, test.se) + ("" if test.p is None else f" ({_probability(test.p)})")


def _notes(table: TableSpec, results: TableResults, sample: SampleSize) -> str:
    """How to read the numbers, and what is not as asked for."""
    printed = any(table.parts[number].printed for number in results.missions.index.unique("part"))
    words = [
        f"Each number: {sample.instances} instances x {sample.trials} trial{'s' * (sample.trials > 1)}, "
        f"seed {sample.seed}; lower is better. "
        "Ours: mean ± standard error over instances (standard deviation over trials of the mean over instances). "
        + "Paper: mean (standard deviation over trials). " * printed
        + "Differences: mean ± standard error over instances (p of Wilcoxon's signed-rank test, two-sided)."
    ]
    fewer = {row: trials for row, trials in _trials(results.missions).items() if trials != sample.trials}
    words += [f"`{name}` has {trials} trial{'s' * (trials > 1)} only, to save time." for name, trials in fewer.items()]
    words += [f"`{name}` is left out: {reason}." for name, reason in table.left_out.items()]
    return " ".join(words)


def _trials(frame: pd.DataFrame) -> dict[str, int]:
    """How many trials each row has of an instance."""
    return frame.groupby("row", sort=False)["trial"].nunique().to_dict()


def _fewer(trials: int, sample: SampleSize) -> str:
    """How many missions a row has, where these are not as many as asked for."""
    return "" if trials == sample.trials else f" ({sample.instances} x {trials})"


def _heading(metric: str, part: TablePart) -> str:
    return f"{METRICS[metric]}, {_missions(part)}:"


def _missions(part: TablePart) -> str:
    scenario = part.scenario
    reach = "global communication" if scenario.comm_range is None else f"communication range {scenario.comm_range:g}"
    return f"{scenario.agents} agents, length scale {scenario.length_scale:g}, {reach}"


def _probability(p: float) -> str:
    """Two digits, and no more zeros than one can read."""
    return f"p = {p:.2g}" if p >= 1e-4 else f"p < 1e{math.ceil(math.log10(p)):d}" if p > 0 else "p = 0"
