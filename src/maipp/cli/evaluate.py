"""`maipp evaluate`: planners on held-out missions, as a table and as JSON."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich import box
from rich.table import Table

from maipp.bench.evaluate import Evaluation, evaluate, save_evaluations, to_json
from maipp.bench.page import three
from maipp.cli.notes import counting_bar, notes_console, results_console
from maipp.cli.options import FieldFlags
from maipp.cli.stopped import stopped_warning
from maipp.errors import InputError
from maipp.fields.raster import Raster
from maipp.planners import make_planner, planner_names, planner_options
from maipp.problem import shape_of
from maipp.scenario import Scenario
from maipp.seeds import check_seed

INTERRUPTED = 130


@dataclass(frozen=True)
class Evaluate(FieldFlags):
    """Score planners on held-out missions; all planners and budgets meet the same worlds.

    With --field that is the file's field, read as `maipp plan` reads it, and missions differ in their starts.
    """

    budget: Annotated[tuple[float, ...], tyro.conf.arg(metavar="LENGTH [LENGTH ...]", help_behavior_hint="")] = ()
    """length of path each agent may travel, domain units; several are evaluated one by one"""

    planner: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PLANNER [PLANNER ...]", help_behavior_hint="")] = ()
    """names (`maipp planners` lists them), or path/to/file.py:ClassName for one of your own"""

    instances: int = 30
    """worlds (ground truth and start)"""

    trials: int = 10
    """runs per world, each with fresh roadmaps and fresh randomness"""

    seed: int = 0
    """seed of the worlds"""

    timing: bool = True
    """measure the time of single decisions as well (costs one more compilation)"""

    json: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """write everything, per-mission values included, to this file; - is standard output"""


def run(flags: Evaluate) -> int:
    """Evaluate row by row, so that an interrupt keeps the rows that are done; gives 130 then."""
    check_seed(flags.seed, "--seed")
    field = flags.read_field(flags.to_scenario(flags.budget[0] if flags.budget else None))
    rows = _rows(flags, field)
    shape = shape_of([scenario for _, scenario, _ in rows])
    to_file = flags.json not in (None, "-")
    if to_file:
        _check_writable(Path(str(flags.json)))
    notes = notes_console()
    done: list[Evaluation] = []
    code, refused = 0, None
    try:
        with counting_bar(notes, "missions") as bar:
            each = flags.instances * flags.trials
            task = bar.add_task("", total=len(rows) * each)
            for planner, scenario, options in rows:
                bar.update(task, description=f"{planner}, budget {_budget(scenario)}")
                before = len(done) * each
                evaluation = evaluate(
                    scenario,
                    planner,
                    options,
                    instances=flags.instances,
                    trials=flags.trials,
                    seed=flags.seed,
                    timing=flags.timing,
                    shape=shape,
                    field=field,
                    progress=lambda missions, _, before=before: bar.update(task, completed=before + missions),
                )
                done.append(evaluation)
                if to_file:
                    save_evaluations(done, str(flags.json))
    except KeyboardInterrupt:
        notes.print(f"interrupted: {len(done)} of {len(rows)} rows are done")
        code = INTERRUPTED
    except InputError as error:  # a row that cannot be scored must not take those that are done with it
        refused = error
    if not done:
        if refused is not None:
            raise refused
        return code
    # The table makes way where standard output is the JSON, and keeps its width where it goes to a file.
    out = results_console(stderr=flags.json == "-")
    out.print(_table(done))
    if flags.json == "-":
        sys.stdout.write(to_json(done))
    elif to_file:
        notes.print(f"wrote {flags.json}")
    for warning in filter(None, map(_stopped, done)):
        notes.print(warning, markup=False)
    if refused is not None:
        raise refused
    return code


def _rows(flags: Evaluate, field: Raster | None = None) -> list[tuple[str, Scenario, dict[str, str]]]:
    """Planner, scenario and options of every row. Raises `InputError` for what is wrong with any of them."""
    if not flags.planner:
        raise InputError(f"--planner: none given; give one or more of {', '.join(planner_names())}")
    names = {planner: {option.name for option in planner_options(planner)} for planner in flags.planner}
    flags.check_weights(flags.planner)
    given = flags.planner_options()
    rows = []
    for budget in flags.budget or (None,):
        scenario = flags.in_field(flags.to_scenario(budget), field)
        for planner, own in names.items():
            # An option goes to the planners that have it; one that nobody has is refused by the first.
            others = set().union(*names.values()) - own
            options = {key: value for key, value in given.items() if key not in others}
            make_planner(planner, scenario, options)  # before any work: a bad option in the last row costs nothing
            rows.append((planner, scenario, options))
    return rows


def _table(evaluations: list[Evaluation]) -> Table:
    """One line per planner and budget, narrow enough for 80 columns."""
    caption = "se: over instances; std: over trials, of the mean; ms and p95: one decision"
    table = Table(title=_title(evaluations), caption=caption, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("planner", max_width=22, overflow="fold")
    # Roadmap planners may leave a rest that no edge fits; where nobody leaves any, the column would say nothing.
    left = any(evaluation.summary["unspent"].mean > 0.0 for evaluation in evaluations)
    headings = ["B", "Tr(P)", "\u00b1 se", "std", "own belief", "true area", "RMSE", *["unspent"] * left, "ms", "p95"]
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=" " not in heading)
    for evaluation in evaluations:
        summary, time = evaluation.summary, evaluation.decision_ms
        table.add_row(
            evaluation.planner.rpartition(":")[2],  # of path/to/file.py:ClassName
            _budget(evaluation.scenario),
            _number(summary["trace"].mean),
            _number(summary["trace"].se),
            _number(summary["trace"].std),
            _number(summary["own_trace"].mean),
            _number(summary["true_trace"].mean),
            _number(summary["rmse"].mean),
            *([_number(summary["unspent"].mean)] if left else []),
            _number(time and time.median),
            _number(time and time.p95),
        )
    return table


def _stopped(evaluation: Evaluation) -> str | None:
    """The warning that the engine stopped agents of this row, if it did."""
    values, scenario = evaluation.values, evaluation.scenario
    return stopped_warning(
        f"{evaluation.planner}, budget {_budget(scenario)}",
        agents=scenario.agents * evaluation.instances * evaluation.trials,
        not_finite=round(values["not_finite"].sum()),
        record_full=round(values["record_full"].sum()),
        unspent=f"{_number(values['unspent'].mean())} domain units each",
    )


def _title(evaluations: list[Evaluation]) -> str:
    if not evaluations:
        return "no results"
    first = evaluations[0]
    return f"{first.scenario.agents} agents, {first.instances} instances x {first.trials} trials, seed {first.seed}"


def _number(value: float | None) -> str:
    """Three significant digits, without an exponent where that is readable."""
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 1000 else three(value)


def _budget(scenario: Scenario) -> str:
    budget = scenario.budget if isinstance(scenario.budget, tuple) else (scenario.budget,)
    return ",".join(f"{length:g}" for length in budget)


def _check_writable(path: Path) -> None:
    """Raises `InputError` before hours of work rather than after them."""
    if path.is_dir():
        raise InputError(f"--json: {path} is a folder; give a file")
    if not path.parent.is_dir():
        raise InputError(f"--json: no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"--json: no permission to write in {path.parent}")
