"""`python -m maipp.benchmarks.planner_table FILE ...`: results of `maipp evaluate --json` as Markdown tables.

With `--page README.md` the tables replace what stands there between the two marker lines.
"""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from maipp.benchmarks import page
from maipp.benchmarks.page import METRICS
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.markdown import filled, markdown_table, typed
from maipp.planners import planner_options
from maipp.scenario import Scenario

START, END = "<!-- table:start -->", "<!-- table:end -->"

_FORMAT = "maipp-evaluations"
# Scenario fields that `maipp evaluate` has a flag for; the others go by --set.
_FLAGS = ("agents", "length_scale", "comm_range", "field")


@dataclass(frozen=True)
class PlannerTable:
    """Turn results of `maipp evaluate --json` into Markdown tables: mean and standard error per planner and budget."""

    files: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE [FILE ...]")]
    """files that `maipp evaluate --json` wrote"""

    metric: tuple[str, ...] = ("trace",)
    """one table for each: trace, own_trace, true_trace, rmse"""

    page: Path | None = None
    """page to write them to, between its marker lines; left out: standard output"""


@dataclass(frozen=True)
class Result:
    """One evaluation as its file has it."""

    row: Mapping[str, Any]  # an entry of "evaluations", see `Evaluation.to_dict`
    file: str  # name of the file, without folders

    @property
    def budget(self) -> str:
        """The budget as a column heading: one number, or one per agent."""
        budget = self.row["scenario"]["budget"]
        return ",".join(f"{length:g}" for length in (budget if isinstance(budget, list) else [budget]))

    @property
    def setting(self) -> dict[str, Any]:
        """The scenario's fields that are not at their defaults, budget aside; the agents always."""
        default, scenario = Scenario().to_dict(), self.row["scenario"]
        return {k: v for k, v in scenario.items() if k == "agents" or (k != "budget" and v != default[k])}

    @property
    def options(self) -> dict[str, str]:
        """The planner's options that are not at their defaults, as one types them; all of them where it is gone."""
        try:
            defaults = {option.name: option.default for option in planner_options(self.row["planner"])}
        except InputError:  # a planner from a file that is no longer there
            defaults = {}
        return {k: typed(v) for k, v in self.row["options"].items() if typed(v) != typed(defaults.get(k, MISSING))}

    @property
    def sample(self) -> tuple[int, int, int]:
        """Instances, trials and seed."""
        return self.row["instances"], self.row["trials"], self.row["seed"]

    def number(self, metric: str) -> str:
        """Mean and standard error of a metric. Raises `InputError` where the file has no finite number for it."""
        summary = self.row["summary"][metric]
        if summary["mean"] is None or not math.isfinite(summary["mean"]):
            raise InputError(f"{self.file}: {self.label} has no finite {metric} at budget {self.budget}; run it again")
        return page.mean_and_error(summary["mean"], summary["se"])

    @property
    def label(self) -> str:
        """The planner and what is special about it."""
        return " ".join([f"`{self.row['planner'].rpartition(':')[2]}`", *(f"{k}={v}" for k, v in self.options.items())])


def read_results(files: Sequence[Path]) -> list[Result]:
    """Every evaluation in the files, in order. Raises `InputError` for a file that is none of `maipp evaluate`'s."""
    results = []
    for path in files:
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        except ValueError as error:
            raise InputError(f"{path}: not JSON: {error}") from None
        if not isinstance(document, dict) or document.get("format") != _FORMAT:
            raise InputError(f"{path}: not the results of an evaluation; give what `maipp evaluate --json FILE` wrote")
        results += [Result(row, path.name) for row in document["evaluations"]]
    if not results:
        raise InputError("the files hold no evaluation; `maipp evaluate --json FILE` writes one per planner and budget")
    return results


def planner_table(results: Sequence[Result], metrics: Sequence[str] = ("trace",), file: Path | None = None) -> str:
    """Markdown tables, one per scenario and metric, and below them what made them and writes them to the page `file`.

    Raises `InputError` for an unknown metric and where two results claim the same cell.
    """
    settings = list({json.dumps(r.setting): r.setting for r in results}.values())
    blocks = []
    for setting in settings:
        there = [r for r in results if r.setting == setting]
        words = ", ".join(f"{key} {typed(value)}" for key, value in setting.items() if key != "agents")
        agents = f"{setting['agents']} agent{'s' * (setting['agents'] > 1)}"
        for number, metric in enumerate(metrics):
            if metric not in METRICS:
                raise InputError(f"metric {metric!r}: there is none of that name; give one of {', '.join(METRICS)}")
            blocks.append(f"{', '.join(filter(None, (METRICS[metric], agents, words)))}:")
            blocks.append(_table(there, metric, facts=number == 0))
    return "\n\n".join([*blocks, _notes(results), _commands(results, metrics, file)])


def _table(results: Sequence[Result], metric: str, *, facts: bool) -> str:
    """One line per planner, one column per budget; with `facts` also what it sends and how long it thinks."""
    budgets = sorted({r.budget for r in results}, key=lambda text: [float(part) for part in text.split(",")])
    several = len({r.sample for r in results}) > 1
    timed = facts and any(r.row["decision_ms"] for r in results)
    lines: dict[tuple[Any, ...], dict[str, Result]] = {}
    for result in results:
        cells = lines.setdefault((result.label, result.sample), {})
        if result.budget in cells:
            where = f"{cells[result.budget].file} and {result.file}" if cells[result.budget].file != result.file else ""
            raise InputError(f"{result.label} at budget {result.budget} is there twice {where}".strip() + "; keep one")
        cells[result.budget] = result
    heading = ["planner", *(f"B = {budget}" for budget in budgets)]
    heading += ["instances x trials, seed"] * several + ["message, bytes"] * facts + ["decision, ms (p95)"] * timed
    rows = []
    for (label, (instances, trials, seed)), cells in lines.items():
        values = [cells[b].number(metric) if b in cells else "" for b in budgets]
        last = max(cells.values(), key=lambda r: budgets.index(r.budget)).row
        time = last["decision_ms"]
        sizes = [str(last["message_bytes"])] * facts
        times = [f"{time['median']:.3g} ({time['p95']:.3g})" if time else ""] * timed
        rows.append([label, *values, *[f"{instances} x {trials}, {seed}"] * several, *sizes, *times])
    return markdown_table(heading, rows)


def _notes(results: Sequence[Result]) -> str:
    """What the numbers are, how many missions they come from, and the machine."""
    words = ["Mean ± standard error over instances; lower is better."]
    samples = {r.sample for r in results}
    if len(samples) == 1:
        ((instances, trials, seed),) = samples
        words.append(f"Each number: {instances} instances x {trials} trial{'s' * (trials > 1)}, seed {seed}.")
    if any(r.row["decision_ms"] for r in results):
        words.append("Decision: median of one at a time, at the largest budget, compilation excluded.")
    return " ".join(words) + f"\nMade on {page.made_on(*((r.row['machine'], r.row['versions']) for r in results))}:"


def _commands(results: Sequence[Result], metrics: Sequence[str], file: Path | None) -> str:
    """The commands that regenerate the files and the tables, as a code block."""
    groups: dict[str, list[Result]] = {}
    for r in results:
        timed = r.row["decision_ms"] is not None
        groups.setdefault(json.dumps([r.file, r.setting, r.sample, sorted(r.options.items()), timed]), []).append(r)
    words = ["python", "-m", "maipp.benchmarks.planner_table", *dict.fromkeys(r.file for r in results)]
    flags = {"metric": tuple(metrics), "page": file and file.name}
    return page.code(*map(_command, groups.values()), page.command(words, flags, {"metric": ("trace",)}))


def _command(group: Sequence[Result]) -> str:
    """The `maipp evaluate` that gives these results: one scenario, sample and set of options."""
    first = group[0]
    own = {key: value for key, value in first.setting.items() if key in _FLAGS}
    settings = [f"{key}={value}" for key, value in first.options.items()]
    for key, value in first.setting.items():
        if key not in own:
            literal = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
            settings.append(f"scenario.{key}={literal}")
    budgets = list(dict.fromkeys(r.budget for r in group))
    if "," in budgets[0]:
        settings.append(f"scenario.budget=[{budgets.pop()}]")
    flags: dict[str, Any] = {"planner": list(dict.fromkeys(r.row["planner"] for r in group))}
    flags |= {key.replace("_", "-"): typed(value) for key, value in own.items()} | {"budget": budgets, "set": settings}
    flags |= dict(zip(("instances", "trials", "seed"), first.sample, strict=True))
    flags |= {"no-timing": first.row["decision_ms"] is None, "json": first.file}
    return page.command(["maipp", "evaluate"], flags, {"budget": [], "set": [], "no-timing": False})


def main(flags: PlannerTable) -> int:
    """Print the tables or write them to the page; gives the exit code."""
    try:
        table = planner_table(read_results(flags.files), flags.metric, flags.page)
        if flags.page is None:
            print(table)
        else:
            write_atomic(flags.page, filled(flags.page.read_text(encoding="utf-8"), START, END, table))
            print(f"wrote {flags.page}", file=sys.stderr)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"error: {flags.page}: cannot be read: {error.strerror}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(PlannerTable, prog="python -m maipp.benchmarks.planner_table")))
