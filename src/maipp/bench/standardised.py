"""`python -m maipp.bench.standardised --out DIR`: how quality holds over length scales and shapes of the area.

A survey of a real place is planned in units of its longest side and of its prior's standard deviation. What is left of
a place then is its length scale and its aspect ratio: this table has what the planners leave for each.
"""

import itertools
import sys
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import tyro

from maipp.bench.cells import Cell, cells, fill
from maipp.bench.command import made_on
from maipp.bench.evaluate import check_counts
from maipp.bench.frame import TableResults, grids, grouped, metrics_of, read, wide
from maipp.bench.page import markdown, shown
from maipp.bench.tables import WORLDS, Row, SampleSize, TablePart, TableSpec
from maipp.bench.tidy_csv import csv_text, short
from maipp.devices import use_all_cores
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.planners import planner_options
from maipp.scenario import Scenario
from maipp.seeds import check_seed

PLANNERS = ("intent-paths", "shared-greedy", "receding-horizon", "lawnmower")


@dataclass(frozen=True)
class Standardised:
    """Tabulate Tr(P) over length scales and aspect ratios; cells that DIR has already are not run again."""

    out: Path
    """folder for standardised.md, standardised.csv and the cells"""

    length_scales: tuple[float, ...] = (0.2, 0.3, 0.45, 0.6, 0.8)
    """of the kernel, in units of the area's longest side"""

    aspects: tuple[float, ...] = (1.0, 2.0, 4.0)
    """width of the area over its height"""

    budgets: tuple[float, ...] = (2.0, 3.0)
    """of each agent, in units of the area's longest side"""

    planners: tuple[str, ...] = PLANNERS
    """planners, with their default options"""

    instances: int = 10
    """worlds"""

    trials: int = 1
    """roadmaps and random draws of the planner for each world"""

    seed: int = 0
    """of the worlds"""

    worlds: str = "prior"
    """prior: fields drawn from the kernel, as where it was fitted to old samples; mixture: those of the paper"""


def spec(flags: Standardised, base: Scenario | None = None) -> TableSpec:
    """The table: a part for each aspect ratio and length scale. Raises InputError for bad flags."""
    if flags.worlds not in WORLDS:
        raise InputError(f"--worlds: {flags.worlds!r} is none; give one of {', '.join(WORLDS)}")
    for name in ("length_scales", "aspects", "budgets"):
        for value in getattr(flags, name):
            if not 0 < value < float("inf"):
                raise InputError(f"--{name.replace('_', '-')}: {value:g} is no length or ratio; give numbers > 0")
    check_counts("--", instances=flags.instances, trials=flags.trials)
    check_seed(flags.seed, "--seed")
    for name in flags.planners:
        planner_options(name)  # raises for an unknown name
    base = Scenario() if base is None else base
    parts = tuple(
        TablePart(base.replace(length_scale=scale, extent=(1.0, 1.0 / aspect)), printed={})
        for aspect, scale in itertools.product(flags.aspects, flags.length_scales)
    )
    rows = tuple(Row(planner, planner) for planner in flags.planners)
    return TableSpec("standardised", "", rows, parts, flags.budgets, worlds=flags.worlds)


def table(spec: TableSpec, results: TableResults, sample: SampleSize) -> str:
    """Markdown: for each budget a table of Tr(P), its standard error, and what it is of the initial trace."""
    blocks = []
    for budget, frame in grouped(results.missions, "column"):
        entries = {}
        for (number, row), values in grids(frame, "trace", ("part", "row")).items():
            scenario = spec.parts[number].scenario
            initial = initial_trace(scenario)
            share = f" ({values.mean() / initial:.2%})" if initial else ""
            entries[*_where(scenario), row] = shown(values) + share
        page = wide(entries).reindex(columns=[row.name for row in spec.rows], fill_value="")
        page = page.rename(columns="`{}`".format).rename_axis(["aspect ratio", "length scale"]).reset_index()
        blocks.append(f"B = {budget:g}:\n\n{markdown(page, left=0)}")
    scenario = spec.parts[results.missions.index[0][0]].scenario
    blocks.append(
        f"Tr(P), mean ± standard error over {sample.instances} worlds x {sample.trials}, seed {sample.seed}; in "
        f"brackets what it is of the initial trace, {initial_trace(scenario):g}. {scenario.agents} agents, threshold "
        f"{scenario.threshold:g} prior standard deviations. {made_on(*results.made)}"
    )
    return "\n\n".join(blocks)


def _where(scenario: Scenario) -> tuple[str, str]:
    """Aspect ratio and length scale."""
    width, height = scenario.extent
    return f"{width / height:g}", f"{scenario.length_scale:g}"


def initial_trace(scenario: Scenario) -> float:
    """Tr(P) before the first measurement: the prior rules no point out as long as its bound reaches the threshold."""
    width = scenario.signal_variance if scenario.interest_rule == "variance" else scenario.signal_variance**0.5
    return scenario.grid_points * scenario.signal_variance if scenario.beta * width >= scenario.threshold else 0.0


def tidy(spec: TableSpec, frame: pd.DataFrame) -> str:
    """CSV: a line for each world and trial, with every metric."""
    metrics = metrics_of(frame)
    aspects = [_where(spec.parts[number].scenario)[0] for number in frame.index.get_level_values("part")]
    names = ["worlds", "aspect", "length_scale", "budget", "planner", "instance", "trial", *metrics]
    formats = dict.fromkeys(("length_scale", "budget"), short) | dict.fromkeys(metrics, "{:.6g}".format)
    whole = frame.assign(worlds=spec.worlds, aspect=aspects, planner=frame["row"])
    return csv_text(whole.reindex(columns=names), formats)


def main(flags: Standardised, base: Scenario | None = None) -> int:
    """Fill the table and write its files; gives the exit code."""
    sample = SampleSize(flags.instances, flags.trials, flags.seed)

    def report(cell: Cell, number: int, count: int, done: bool) -> None:
        if not done:
            where = "aspect {}, length scale {}".format(*_where(cell.scenario))
            print(f"{number + 1}/{count}: {where}, B = {cell.budget:g}, {cell.row.name}", file=sys.stderr, flush=True)

    try:
        filled = spec(flags, base)
        fill(list(cells(filled, filled.rows, sample)), flags.out, report)
        results = read(filled, flags.out, sample)
        write_atomic(flags.out / "standardised.md", table(filled, results, sample) + "\n")
        write_atomic(flags.out / "standardised.csv", tidy(filled, results.missions))
        print(f"wrote {flags.out / 'standardised.md'} and standardised.csv", file=sys.stderr)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; what is done is kept: the same command goes on from there", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    use_all_cores()
    sys.exit(main(tyro.cli(Standardised, prog="python -m maipp.bench.standardised")))
