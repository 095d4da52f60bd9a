"""What `maipp evaluate` prints: means, and differences in pairs."""

from collections.abc import Sequence

from rich import box
from rich.table import Table

from maipp.bench.comparison import Comparison, label
from maipp.bench.evaluate import Evaluation
from maipp.bench.page import three
from maipp.cli.stopped import stopped_warning
from maipp.foresight.map_scores import SUFFIXES
from maipp.scenario import Scenario


def means(evaluations: Sequence[Evaluation]) -> Table:
    """One line per planner and budget, narrow enough for 80 columns."""
    caption = "se: over instances; std: over trials, of the mean; ms and p95: one decision"
    table = Table(title=_title(evaluations), caption=caption, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("planner", max_width=22, overflow="fold")
    # Roadmap planners may leave a rest that no edge fits; where nobody leaves any, the column would say nothing.
    left = any(evaluation.summary["unspent"].mean > 0.0 for evaluation in evaluations)
    # Of a map: its error and its intervals, and the belief's.
    drawn = list(dict.fromkeys(name for each in evaluations for name in each.values if name.endswith(SUFFIXES)))
    maps = [name.replace("rmse", "RMSE").replace("_", " ") for name in drawn]
    headings = ["B", "Tr(P)", "\u00b1 se", "std", "own belief", "true area", "RMSE", *maps, *["unspent"] * left]
    for heading in [*headings, "ms", "p95"]:
        table.add_column(heading, justify="right", no_wrap=" " not in heading)
    for evaluation in evaluations:
        summary, time = evaluation.summary, evaluation.decision_ms
        table.add_row(
            _short(label(evaluation, *evaluations)),
            budget_of(evaluation.scenario),
            _number(summary["trace"].mean),
            _number(summary["trace"].se),
            _number(summary["trace"].std),
            _number(summary["own_trace"].mean),
            _number(summary["true_trace"].mean),
            _number(summary["rmse"].mean),
            *(_number(summary[name].mean if name in summary else None) for name in drawn),
            *([_number(summary["unspent"].mean)] if left else []),
            _number(time and time.median),
            _number(time and time.p95),
        )
    return table


def differences(comparisons: Sequence[Comparison], reference: str) -> Table:
    """One line per metric, planner and budget: how it differs from the reference in the same worlds."""
    title = f"minus {_short(reference)}, in pairs over the same instances"
    caption = (
        "95 %: interval by Student's t; p: Wilcoxon's signed-rank test; Holm: adjusted for all lines of a metric; "
        "metrics that are the same for all are left out"
    )
    table = Table(title=title, caption=caption, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("metric", no_wrap=True)
    table.add_column("planner", max_width=22, overflow="fold")
    for heading in ("B", "difference", "\u00b1 se", "95 %", "p", "Holm"):
        table.add_column(heading, justify="right", no_wrap=True)
    for each in comparisons:
        test = each.difference
        ends = None if test.interval is None else " to ".join(map(_number, test.interval))
        row = [_number(test.mean), _number(test.se), ends or "-", _chance(test.p), _chance(each.holm)]
        name = _short(label(each.evaluation, *(other.evaluation for other in comparisons)))
        table.add_row(each.metric, name, budget_of(each.evaluation.scenario), *row)
    return table


def stopped(evaluation: Evaluation) -> str | None:
    """The warning that the engine stopped agents of this row, if it did."""
    values, scenario = evaluation.values, evaluation.scenario
    return stopped_warning(
        f"{evaluation.planner}, budget {budget_of(scenario)}",
        agents=scenario.agents * evaluation.instances * evaluation.trials,
        not_finite=round(values["not_finite"].sum()),
        record_full=round(values["record_full"].sum()),
        unspent=f"{_number(values['unspent'].mean())} domain units each",
    )


def budget_of(scenario: Scenario) -> str:
    """The budget, or those of all agents."""
    budget = scenario.budget if isinstance(scenario.budget, tuple) else (scenario.budget,)
    return ",".join(f"{length:g}" for length in budget)


def _title(evaluations: Sequence[Evaluation]) -> str:
    first = evaluations[0]
    which = f", from number {first.first} on" if first.first else ""
    counts = f"{first.instances} instances{which} x {first.trials} trials"
    return f"{first.scenario.agents} agents, {counts}, seed {first.seed}"


def _short(name: str) -> str:
    """The class alone, of path/to/file.py:ClassName."""
    planner, space, options = name.partition(" ")
    return planner.rpartition(":")[2] + space + options


def _number(value: float | None) -> str:
    """Three significant digits, without an exponent where that is readable."""
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 1000 else three(value)


def _chance(p: float | None) -> str:
    if p is None:
        return "-"
    return "<.001" if p < 0.001 else f"{p:.3f}".lstrip("0")
