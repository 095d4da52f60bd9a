"""A table as Markdown: the paper's numbers beside ours, paired tests, and what made them."""

import math
import shlex
from collections.abc import Iterable, Sequence

from maipp.benchmarks import paper
from maipp.benchmarks.cells import CellResult
from maipp.benchmarks.evaluate import summarise
from maipp.benchmarks.machine import device_time, made_on
from maipp.benchmarks.paired import paired
from maipp.benchmarks.planner_table import METRICS, mean_and_error
from maipp.benchmarks.table_run import Line, Sample
from maipp.benchmarks.tables import Part, TableSpec

DEFAULT_SAMPLE, QUICK_SAMPLE = Sample(), Sample(trials=1)


def table_page(
    table: TableSpec, lines: Sequence[Line], sample: Sample, *, out: str, reference: str, files: Sequence[str] = ()
) -> str:
    """The whole page below its heading: one table per part and metric, paired tests, command, versions, wall time.

    `out` is the folder that the command is given, `reference` the row that others are paired with, `files` what lies
    beside the page.
    """
    blocks = [f"{table.title}."]
    for part in table.parts:
        there = [line for line in lines if line.part is part]
        if not there:
            continue
        blocks += [f"{METRICS[table.metric]}, {_missions(part)}:", _main(table, there, sample), _half(table, there)]
        blocks += _compared(table, part, there, reference)
        for metric in table.beside:
            blocks += [f"{METRICS[metric]}, {_missions(part)}:", _plain(table, metric, there)]
    blocks.append(_notes(table, lines, sample))
    blocks += [f"![{table.title}]({name})" for name in files if name.endswith(".png")]
    blocks += [f"Every instance and trial: [{name}]({name})." for name in files if name.endswith(".csv.gz")]
    blocks.append(f"```sh\n{command(table, lines, sample, out, reference)}\n```")
    seconds = sum(result.wall_s * result.machine["devices"] for result in _results(lines))
    blocks += [_made_on(lines), device_time(seconds, "the cells above")]
    return "\n\n".join(block for block in blocks if block) + "\n"


def brief_page(table: TableSpec, lines: Sequence[Line], sample: Sample, *, out: str) -> str:
    """The short form: every row's number at every budget, how many missions they come from, and the command."""
    blocks = []
    for part in table.parts:
        there = [line for line in lines if line.part is part]
        rows = [
            [_described(line, sample), *(_cell(line.results[b], table.metric) for b in table.budgets)] for line in there
        ]
        heading = ["planner", *(f"B = {budget:g}" for budget in table.budgets)]
        blocks += [f"{METRICS[table.metric]}, {_missions(part)}:", _markdown(heading, rows)] if there else []
    trials = f"{sample.trials} trial{'s' * (sample.trials > 1)}"
    blocks.append(
        f"Mean ± standard error over {sample.instances} instances of {trials} each, seed {sample.seed}, unless said; "
        f"lower is better. {_made_on(lines)}"
    )
    return "\n\n".join([*blocks, f"```sh\n{command(table, lines, sample, out, table.reference)}\n```"]) + "\n"


def command(table: TableSpec, lines: Sequence[Line], sample: Sample, out: str, reference: str) -> str:
    """The command that fills the table with these lines."""
    words = ["maipp", "benchmark", table.name, "--out", out]
    quick = sample[:2] == QUICK_SAMPLE[:2]
    if quick:
        words.append("--quick")
    else:
        for name, given, usual in zip(Sample._fields[:2], sample, DEFAULT_SAMPLE, strict=False):
            words += [f"--{name}", str(given)] if given != usual else []
    words += ["--seed", str(sample.seed)] if sample.seed else []
    rows = list(dict.fromkeys(line.row.name for line in lines))
    usual = [row.name for row in table.chosen(()) if row.quick or not quick]
    words += ["--planners", *rows] if rows != usual else []
    words += ["--reference", reference] if reference != table.reference else []
    return shlex.join(words)


def _main(table: TableSpec, lines: Sequence[Line], sample: Sample) -> str:
    """The paper's number and ours, budget by budget."""
    heading = ["row", "planner and options", "in the paper"]
    for budget in table.budgets:
        heading += [f"B = {budget:g}, paper", f"B = {budget:g}"]
    rows = []
    for line in lines:
        printed = line.part.printed.get(line.row.paper or "", {})
        label = "" if line.row.label == f"`{line.row.name}`" else line.row.label
        row = [_name(line, sample), label, line.row.paper if printed and line.row.paper else ""]
        for budget in table.budgets:
            row.append(f"{printed[budget].mean:.2f} ({printed[budget].std:.2f})" if budget in printed else "")
            row.append(_cell(line.results[budget], table.metric, std=True))
        rows.append(row)
    return _markdown(heading, rows, left=3)


def _plain(table: TableSpec, metric: str, lines: Sequence[Line]) -> str:
    rows = [[_name(line), *(_cell(line.results[b], metric) for b in table.budgets)] for line in lines]
    return _markdown(["row", *(f"B = {budget:g}" for budget in table.budgets)], rows)


def _half(table: TableSpec, lines: Sequence[Line]) -> str:
    """Which rows are as good as the paper's best one, and which leave at most half of that."""
    best = [paper.best(lines[0].part.printed, budget) for budget in table.budgets]

    def within(share: float) -> str:
        """The rows at or below this share of the paper's best in every cell."""
        good = [
            line.row.name
            for line in lines
            if all(
                summarise(line.results[budget].values[table.metric]).mean <= share * least
                for budget, least in zip(table.budgets, best, strict=True)
            )
        ]
        return ", ".join(f"`{name}`" for name in good) or "none"

    return (
        f"The paper's best: {', '.join(f'{least:.2f}' for least in best)}. At or below it at every budget: "
        f"{within(1.0)}. At or below half of it at every budget: {within(0.5)}."
    )


def _compared(table: TableSpec, part: Part, lines: Sequence[Line], reference: str) -> list[str]:
    """The other rows minus the reference, on the same instances."""
    base = next((line for line in lines if line.row.name == reference), None)
    if base is None or len(lines) < 2:
        return []

    def cell(line: Line, budget: float) -> str:
        values, others = (each.results[budget].values[table.metric] for each in (line, base))
        test = paired(values, others)
        return _difference(test.mean, test.se) + ("" if test.p is None else f" ({_probability(test.p)})")

    rows = [[_name(line), *(cell(line, b) for b in table.budgets)] for line in lines if line is not base]
    heading = ["row", *(f"B = {budget:g}" for budget in table.budgets)]
    title = f"{METRICS[table.metric]} minus that of `{reference}` on the same instances, {_missions(part)}:"
    return [title, _markdown(heading, rows)]


def _notes(table: TableSpec, lines: Sequence[Line], sample: Sample) -> str:
    """How to read the numbers, and what is not as asked for."""
    words = [
        f"Each number: {sample.instances} instances x {sample.trials} trial{'s' * (sample.trials > 1)}, "
        f"seed {sample.seed}; lower is better. "
        "Ours: mean ± standard error over instances (standard deviation over trials of the mean over instances). "
        "Paper: mean (standard deviation over trials). "
        "Differences: mean ± standard error over instances (p of Wilcoxon's signed-rank test, two-sided)."
    ]
    fewer = {line.row.name: trials for line in lines if (trials := _trials(line)) != sample.trials}
    words += [f"`{name}` has {trials} trial{'s' * (trials > 1)} only, to save time." for name, trials in fewer.items()]
    words += [f"`{name}` is left out: {reason}." for name, reason in table.left_out.items()]
    return " ".join(words)


def _made_on(lines: Sequence[Line]) -> str:
    """Machines and versions, each once."""
    made = (made_on(result.machine, result.versions) for result in _results(lines))
    return "Made on " + "; and on ".join(dict.fromkeys(made)) + "."


def _results(lines: Iterable[Line]) -> Iterable[CellResult]:
    return (result for line in lines for result in line.results.values())


def _trials(line: Line) -> int:
    return next(iter(next(iter(line.results.values())).values.values())).shape[1]


def _name(line: Line, sample: Sample | None = None) -> str:
    """The row's name; with a sample, also how many missions it has where these are fewer."""
    fewer = sample is not None and _trials(line) != sample.trials
    return f"`{line.row.name}`" + (f" ({sample.instances} x {_trials(line)})" if fewer and sample else "")


def _described(line: Line, sample: Sample) -> str:
    """The planner with its options, and how many missions it has where these are fewer."""
    return line.row.label + (f" ({sample.instances} x {_trials(line)})" if _trials(line) != sample.trials else "")


def _missions(part: Part) -> str:
    scenario = part.scenario
    reach = "global communication" if scenario.comm_range is None else f"communication range {scenario.comm_range:g}"
    return f"{scenario.agents} agents, length scale {scenario.length_scale:g}, {reach}"


def _cell(result: CellResult, metric: str, *, std: bool = False) -> str:
    summary = summarise(result.values[metric])
    spread = f" ({f'{summary.std:#.2g}'.rstrip('.')})" if std and summary.std is not None else ""
    return mean_and_error(summary.mean, summary.se) + spread


def _difference(mean: float, se: float | None) -> str:
    shown = mean_and_error(mean, se)
    return shown if mean < 0 else f"+{shown}"


def _probability(p: float) -> str:
    """Two digits, and no more zeros than one can read."""
    return f"p = {p:.2g}" if p >= 1e-4 else f"p < 1e{math.ceil(math.log10(p)):d}" if p > 0 else "p = 0"


def _markdown(heading: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    ruler = ["---"] * left + ["---:"] * (len(heading) - left)
    return "\n".join(f"| {' | '.join(row)} |" for row in [heading, ruler, *rows])
