"""A table as Markdown: the paper's numbers beside ours, paired tests, and what made them."""

import math
from collections.abc import Callable, Iterable, Sequence

from maipp.bench import page
from maipp.bench.cells import CellResult, Line
from maipp.bench.comparison import paired
from maipp.bench.evaluate import summarise
from maipp.bench.page import METRICS
from maipp.bench.tables import Part, Sample, TableSpec, best
from maipp.markdown import markdown_table


def table_page(
    table: TableSpec, lines: Sequence[Line], sample: Sample, *, out: str, reference: str, files: Sequence[str] = ()
) -> str:
    """The whole page below its heading: one table per part and metric, paired tests, command, versions, wall time.

    `out` is the folder that the command is given, `reference` the row that others are paired with, `files` what lies
    beside the page.
    """
    blocks = [f"{table.title}."]
    for part, there in _parts(table, lines):
        blocks += [f"{METRICS[table.metric]}, {_missions(part)}:", _main(table, there, sample), _half(table, there)]
        blocks += _compared(table, part, there, reference)
        for metric in table.beside:
            cell = _mean(metric)
            blocks += [f"{METRICS[metric]}, {_missions(part)}:", _by_column(table, there, "row", _name, cell)]
    blocks.append(_notes(table, lines, sample))
    blocks += [f"![{table.title}]({name})" for name in files if name.endswith(".png")]
    blocks += [f"Every instance and trial: [{name}]({name})." for name in files if name.endswith(".csv.gz")]
    seconds = sum(result.wall_s * result.machine["devices"] for result in _results(lines))
    blocks.append(page.code(command(table, lines, sample, out, reference)))
    blocks += [made_on(lines), page.device_time(seconds, "the cells above")]
    return "\n\n".join(block for block in blocks if block) + "\n"


def brief_page(table: TableSpec, lines: Sequence[Line], sample: Sample, *, out: str) -> str:
    """The short form: every row's number at every budget, how many missions they come from, and the command."""
    blocks = []
    for part, there in _parts(table, lines):
        numbers = _by_column(
            table, there, "planner", lambda line: _named(line, line.row.label, sample), _mean(table.metric)
        )
        blocks += [f"{METRICS[table.metric]}, {_missions(part)}:", numbers]
    trials = f"{sample.trials} trial{'s' * (sample.trials > 1)}"
    blocks.append(
        f"Mean ± standard error over {sample.instances} instances of {trials} each, seed {sample.seed}, unless said; "
        f"lower is better. {made_on(lines)}"
    )
    blocks.append(page.code(command(table, lines, sample, out, table.reference)))
    return "\n\n".join(blocks) + "\n"


def quick_sample(table: TableSpec) -> Sample:
    """How many missions each cell has in a quick look."""
    return table.sample._replace(trials=1)


def command(table: TableSpec, lines: Sequence[Line], sample: Sample, out: str, reference: str) -> str:
    """The command that fills the table with these lines."""
    quick = sample[:2] == quick_sample(table)[:2] != table.sample[:2]
    flags = {"quick": quick, **sample._asdict(), "planners": list(dict.fromkeys(line.row.name for line in lines))}
    usual = {"quick": False, **(quick_sample(table) if quick else table.sample)._asdict(), "reference": table.reference}
    usual["planners"] = [row.name for row in table.chosen(()) if row.quick or not quick]
    return page.command(
        ["maipp", "benchmark", table.typed or table.name, "--out", out], flags | {"reference": reference}, usual
    )


def _parts(table: TableSpec, lines: Sequence[Line]) -> Iterable[tuple[Part, list[Line]]]:
    """The parts of which there are lines, with these."""
    every = ((part, [line for line in lines if line.part is part]) for part in table.parts)
    return ((part, there) for part, there in every if there)


def _by_column(
    table: TableSpec,
    lines: Iterable[Line],
    what: str,
    name: Callable[[Line], str],
    cell: Callable[[Line, float], str],
) -> str:
    """A line for each row, and its columns."""
    rows = [[name(line), *(cell(line, column) for column in table.columns)] for line in lines]
    return markdown_table([what, *map(table.heading, table.columns)], rows)


def _mean(metric: str) -> Callable[[Line, float], str]:
    """What a cell has of a metric."""
    return lambda line, column: page.shown(line.results[column].values[metric])


def _main(table: TableSpec, lines: Sequence[Line], sample: Sample) -> str:
    """The paper's number and ours, column by column."""
    beside = bool(lines[0].part.printed)  # there are numbers of the paper
    heading = ["row", "planner and options", *["in the paper"] * beside]
    for column in table.columns:
        heading += [*[f"{table.heading(column)}, paper"] * beside, table.heading(column)]
    rows = []
    for line in lines:
        printed = line.part.printed.get(line.row.paper or "", {})
        label = "" if line.row.label == f"`{line.row.name}`" else line.row.label
        row = [_name(line, sample), label, *[line.row.paper if printed and line.row.paper else ""] * beside]
        for column in table.columns:
            if beside:
                row.append(f"{printed[column].mean:.2f} ({printed[column].std:.2f})" if column in printed else "")
            values = line.results[column].values[table.metric]
            std = summarise(values).std
            row.append(page.shown(values) + ("" if std is None else f" ({f'{std:#.2g}'.rstrip('.')})"))
        rows.append(row)
    return markdown_table(heading, rows, left=2 + beside)


def _half(table: TableSpec, lines: Sequence[Line]) -> str:
    """Which rows are as good as the paper's best one, and which leave at most half of that."""
    if not lines[0].part.printed:
        return ""
    lowest = [best(lines[0].part.printed, column) for column in table.columns]

    def within(share: float) -> str:
        """The rows at or below this share of the paper's best in every cell."""
        good = [
            line.row.name
            for line in lines
            if all(
                summarise(line.results[column].values[table.metric]).mean <= share * least
                for column, least in zip(table.columns, lowest, strict=True)
            )
        ]
        return ", ".join(f"`{name}`" for name in good) or "none"

    return (
        f"The paper's best: {', '.join(f'{least:.2f}' for least in lowest)}. At or below it at every budget: "
        f"{within(1.0)}. At or below half of it at every budget: {within(0.5)}."
    )


def _compared(table: TableSpec, part: Part, lines: Sequence[Line], reference: str) -> list[str]:
    """The other rows minus the reference, on the same instances."""
    base = next((line for line in lines if line.row.name == reference), None)
    if base is None or len(lines) < 2:
        return []

    def cell(line: Line, column: float) -> str:
        test = paired(*(each.results[column].values[table.metric] for each in (line, base)))
        sign = "" if test.mean < 0 else "+"
        return sign + page.mean_and_error(test.mean, test.se) + ("" if test.p is None else f" ({_probability(test.p)})")

    title = f"{METRICS[table.metric]} minus that of `{reference}` on the same instances, {_missions(part)}:"
    return [title, _by_column(table, (line for line in lines if line is not base), "row", _name, cell)]


def _notes(table: TableSpec, lines: Sequence[Line], sample: Sample) -> str:
    """How to read the numbers, and what is not as asked for."""
    words = [
        f"Each number: {sample.instances} instances x {sample.trials} trial{'s' * (sample.trials > 1)}, "
        f"seed {sample.seed}; lower is better. "
        "Ours: mean ± standard error over instances (standard deviation over trials of the mean over instances). "
        + "Paper: mean (standard deviation over trials). " * any(line.part.printed for line in lines)
        + "Differences: mean ± standard error over instances (p of Wilcoxon's signed-rank test, two-sided)."
    ]
    fewer = {line.row.name: trials for line in lines if (trials := _trials(line)) != sample.trials}
    words += [f"`{name}` has {trials} trial{'s' * (trials > 1)} only, to save time." for name, trials in fewer.items()]
    words += [f"`{name}` is left out: {reason}." for name, reason in table.left_out.items()]
    return " ".join(words)


def made_on(lines: Sequence[Line]) -> str:
    """Machines and versions, each once."""
    return f"Made on {page.made_on(*((result.machine, result.versions) for result in _results(lines)))}."


def _results(lines: Iterable[Line]) -> Iterable[CellResult]:
    return (result for line in lines for result in line.results.values())


def _trials(line: Line) -> int:
    return next(iter(next(iter(line.results.values())).values.values())).shape[1]


def _name(line: Line, sample: Sample | None = None) -> str:
    """The row's name."""
    return _named(line, f"`{line.row.name}`", sample)


def _named(line: Line, name: str, sample: Sample | None) -> str:
    """The name; with a sample, also how many missions the line has where these are fewer."""
    if sample is None or _trials(line) == sample.trials:
        return name
    return f"{name} ({sample.instances} x {_trials(line)})"


def _missions(part: Part) -> str:
    scenario = part.scenario
    reach = "global communication" if scenario.comm_range is None else f"communication range {scenario.comm_range:g}"
    return f"{scenario.agents} agents, length scale {scenario.length_scale:g}, {reach}"


def _probability(p: float) -> str:
    """Two digits, and no more zeros than one can read."""
    return f"p = {p:.2g}" if p >= 1e-4 else f"p < 1e{math.ceil(math.log10(p)):d}" if p > 0 else "p = 0"
