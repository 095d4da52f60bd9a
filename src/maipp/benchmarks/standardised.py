"""`python -m maipp.benchmarks.standardised --out DIR`: how quality holds over length scales and shapes of the area.

A survey of a real place is planned in units of its longest side and of its prior's standard deviation. What is left of
a place then is its length scale and its aspect ratio: this table has what the planners leave for each.
"""

import csv
import io
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from maipp.benchmarks.cells import Cell, CellResult
from maipp.benchmarks.evaluate import summarise
from maipp.benchmarks.machine import made_on
from maipp.benchmarks.planner_table import mean_and_error
from maipp.benchmarks.prior_worlds import PriorCell
from maipp.benchmarks.table_rows import Row
from maipp.devices import use_all_cores
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.planners import planner_options
from maipp.problem import shape_of
from maipp.scenario import Scenario
from maipp.seeds import check_seed

PLANNERS = ("ti-star", "shared-greedy", "receding-horizon", "lawnmower")
WORLDS = {"prior": PriorCell, "mixture": Cell}


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


@dataclass(frozen=True, eq=False)
class Place:
    """One cell of the table, and where in it."""

    aspect: float
    length_scale: float
    budget: float
    planner: str
    cell: Cell


def places(flags: Standardised, base: Scenario | None = None) -> Iterator[Place]:
    """Every cell; those that share a compilation are next to each other. Raises InputError for bad flags."""
    if flags.worlds not in WORLDS:
        raise InputError(f"--worlds: {flags.worlds!r} is none; give one of {', '.join(WORLDS)}")
    for name, values in (
        ("length-scales", flags.length_scales),
        ("aspects", flags.aspects),
        ("budgets", flags.budgets),
    ):
        for value in values:
            if not 0 < value < float("inf"):
                raise InputError(f"--{name}: {value:g} is no length or ratio; give numbers > 0")
    for name, count in (("instances", flags.instances), ("trials", flags.trials)):
        if count < 1:
            raise InputError(f"--{name}: {count} is too few; give a whole number >= 1")
    check_seed(flags.seed, "--seed")
    for name in flags.planners:
        planner_options(name)  # raises for an unknown name
    base = Scenario() if base is None else base
    for aspect in flags.aspects:
        for scale in flags.length_scales:
            scenario = base.replace(length_scale=scale, extent=(1.0, 1.0 / aspect))
            shape = shape_of([scenario.replace(budget=budget) for budget in flags.budgets])
            for planner in flags.planners:
                row = Row(planner, planner)
                for budget in flags.budgets:
                    kind = WORLDS[flags.worlds]
                    cell = kind(
                        row,
                        scenario.replace(budget=budget),
                        flags.instances,
                        flags.trials,
                        flags.seed,
                        shape,
                    )
                    yield Place(aspect, scale, budget, planner, cell)


def fill(every: Sequence[Place], folder: Path, report: Callable[[str], None]) -> None:
    """Compute and keep the cells that the folder lacks; an interrupt loses the one it meets."""
    missing = [place for place in every if place.cell.load(folder) is None]
    for number, place in enumerate(missing):
        result = place.cell.compute()
        place.cell.save(result, folder)
        trace = result.values["trace"].mean()
        where = f"aspect {place.aspect:g}, length scale {place.length_scale:g}, B = {place.budget:g}"
        report(f"{number + 1}/{len(missing)}: {where}, {place.planner}: Tr(P) {trace:.3g}, {result.wall_s:.0f} s")


def table(every: Sequence[Place], folder: Path) -> str:
    """Markdown: for each budget a table of Tr(P), its standard error, and what it is of the initial trace.

    Places whose cell is not computed yet stay empty; rows without any cell are left out.
    """
    results = {place: result for place in every if (result := place.cell.load(folder)) is not None}
    if not results:
        raise InputError(f"{folder}: holds no cell of this table; run it first")
    planners = list(dict.fromkeys(place.planner for place in every))
    heading = ["aspect ratio", "length scale", *(f"`{planner}`" for planner in planners)]
    blocks = []
    for budget in dict.fromkeys(place.budget for place in every):
        rows = []
        for aspect, scale in dict.fromkeys((place.aspect, place.length_scale) for place in every):
            here = {
                p.planner: (p, r)
                for p, r in results.items()
                if (p.aspect, p.length_scale, p.budget) == (aspect, scale, budget)
            }
            if here:
                cells = [_entry(*here[planner]) if planner in here else "" for planner in planners]
                rows.append([f"{aspect:g}", f"{scale:g}", *cells])
        ruler = ["---:"] * len(heading)
        lines = "\n".join(f"| {' | '.join(row)} |" for row in [heading, ruler, *rows])
        blocks.append(f"B = {budget:g}:\n\n{lines}")
    first = next(iter(results))
    made = dict.fromkeys(made_on(r.machine, r.versions) for r in results.values())
    sample = f"{first.cell.instances} worlds x {first.cell.trials}, seed {first.cell.seed}"
    initial = f"{initial_trace(first.cell.scenario):g}"
    return "\n\n".join(
        [
            *blocks,
            f"Tr(P), mean ± standard error over {sample}; in brackets what it is of the initial trace, {initial}. "
            f"{first.cell.scenario.agents} agents, threshold {first.cell.scenario.threshold:g} prior standard "
            f"deviations. Made on {'; and on '.join(made)}.",
        ]
    )


def initial_trace(scenario: Scenario) -> float:
    """Tr(P) before the first measurement: the prior rules no point out as long as its bound reaches the threshold."""
    width = scenario.signal_variance if scenario.interest_rule == "variance" else scenario.signal_variance**0.5
    return scenario.grid_points * scenario.signal_variance if scenario.beta * width >= scenario.threshold else 0.0


def tidy(every: Sequence[Place], folder: Path) -> str:
    """CSV: a line for each world and trial, with every metric."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    metrics: list[str] = []
    for place in every:
        result = place.cell.load(folder)
        if result is None:
            continue
        if not metrics:
            metrics = list(result.values)
            writer.writerow(["worlds", "aspect", "length_scale", "budget", "planner", "instance", "trial", *metrics])
        worlds = next(name for name, kind in WORLDS.items() if type(place.cell) is kind)
        about = [worlds, f"{place.aspect:g}", f"{place.length_scale:g}", f"{place.budget:g}", place.planner]
        for index in np.ndindex(result.values["trace"].shape):
            writer.writerow([*about, *index, *(f"{result.values[metric][index]:.6g}" for metric in metrics)])
    return out.getvalue()


def _entry(place: Place, result: CellResult) -> str:
    summary = summarise(result.values["trace"])
    initial = initial_trace(place.cell.scenario)
    share = f" ({summary.mean / initial:.2%})" if initial else ""
    return f"{mean_and_error(summary.mean, summary.se)}{share}"


def main(flags: Standardised, base: Scenario | None = None) -> int:
    """Fill the table and write its files; gives the exit code."""
    try:
        every = list(places(flags, base))
        fill(every, flags.out, lambda line: print(line, file=sys.stderr, flush=True))
        write_atomic(flags.out / "standardised.md", table(every, flags.out) + "\n")
        write_atomic(flags.out / "standardised.csv", tidy(every, flags.out))
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
    sys.exit(main(tyro.cli(Standardised, prog="python -m maipp.benchmarks.standardised")))
