"""`python -m maipp.benchmarks.standardised --out DIR`: how quality holds over length scales and shapes of the area.

A survey of a real place is planned in units of its longest side and of its prior's standard deviation. What is left of
a place then is its length scale and its aspect ratio: this table has what the planners leave for each.
"""

import itertools
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from maipp.benchmarks.cells import Cell, CellResult
from maipp.benchmarks.evaluate import check_counts
from maipp.benchmarks.output import csv_text
from maipp.benchmarks.page import made_on, shown
from maipp.benchmarks.prior_worlds import PriorCell
from maipp.benchmarks.table_rows import Row
from maipp.devices import use_all_cores
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.markdown import markdown_table
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


def cells(flags: Standardised, base: Scenario | None = None) -> Iterator[Cell]:
    """Every cell; those that share a compilation are next to each other. Raises InputError for bad flags."""
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
    base, kind = Scenario() if base is None else base, WORLDS[flags.worlds]
    sample = flags.instances, flags.trials, flags.seed
    for aspect, scale in itertools.product(flags.aspects, flags.length_scales):
        scenario = base.replace(length_scale=scale, extent=(1.0, 1.0 / aspect))
        shape = shape_of([scenario.replace(budget=budget) for budget in flags.budgets])
        for planner, budget in itertools.product(flags.planners, flags.budgets):
            yield kind(Row(planner, planner), scenario.replace(budget=budget), *sample, shape)


def fill(every: Sequence[Cell], folder: Path, report: Callable[[str], None]) -> None:
    """Compute and keep the cells that the folder lacks; an interrupt loses the one it meets."""
    missing = [cell for cell in every if cell.load(folder) is None]
    for number, cell in enumerate(missing):
        result = cell.compute()
        cell.save(result, folder)
        aspect, scale, budget = _where(cell)
        where = f"aspect {aspect}, length scale {scale}, B = {budget}, {cell.row.planner}"
        trace = result.values["trace"].mean()
        report(f"{number + 1}/{len(missing)}: {where}: Tr(P) {trace:.3g}, {result.wall_s:.0f} s")


def read(every: Sequence[Cell], folder: Path) -> list[tuple[Cell, CellResult]]:
    """The cells that the folder has, with what they came to. Raises InputError where there are none."""
    found = [(cell, result) for cell in every if (result := cell.load(folder)) is not None]
    if not found:
        raise InputError(f"{folder}: holds no cell of this table; run it first")
    return found


def table(found: Sequence[tuple[Cell, CellResult]]) -> str:
    """Markdown: for each budget a table of Tr(P), its standard error, and what it is of the initial trace.

    What was not computed for one planner, but for another, stays empty.
    """
    planners = list(dict.fromkeys(cell.row.planner for cell, _ in found))
    budgets: dict[str, dict[tuple[str, ...], dict[str, str]]] = {}
    for cell, result in found:
        *row, budget = _where(cell)
        values, initial = result.values["trace"], initial_trace(cell.scenario)
        entry = shown(values) + (f" ({values.mean() / initial:.2%})" if initial else "")
        budgets.setdefault(budget, {}).setdefault(tuple(row), {})[cell.row.planner] = entry
    blocks = []
    for budget, lines in budgets.items():
        rows = [[*row, *(line.get(planner, "") for planner in planners)] for row, line in lines.items()]
        heading = ["aspect ratio", "length scale", *(f"`{planner}`" for planner in planners)]
        blocks.append(f"B = {budget}:\n\n{markdown_table(heading, rows, left=0)}")
    cell, scenario = found[0][0], found[0][0].scenario
    blocks.append(
        f"Tr(P), mean ± standard error over {cell.instances} worlds x {cell.trials}, seed {cell.seed}; in brackets "
        f"what it is of the initial trace, {initial_trace(scenario):g}. {scenario.agents} agents, threshold "
        f"{scenario.threshold:g} prior standard deviations. "
        f"Made on {made_on(*((result.machine, result.versions) for _, result in found))}."
    )
    return "\n\n".join(blocks)


def _where(cell: Cell) -> tuple[str, str, str]:
    """Aspect ratio, length scale and budget."""
    width, height = cell.scenario.extent
    return f"{width / height:g}", f"{cell.scenario.length_scale:g}", f"{cell.budget:g}"


def initial_trace(scenario: Scenario) -> float:
    """Tr(P) before the first measurement: the prior rules no point out as long as its bound reaches the threshold."""
    width = scenario.signal_variance if scenario.interest_rule == "variance" else scenario.signal_variance**0.5
    return scenario.grid_points * scenario.signal_variance if scenario.beta * width >= scenario.threshold else 0.0


def tidy(found: Sequence[tuple[Cell, CellResult]], worlds: str) -> str:
    """CSV: a line for each world and trial, with every metric."""
    metrics = list(found[0][1].values)
    return csv_text(
        ("worlds", "aspect", "length_scale", "budget", "planner", "instance", "trial", *metrics),
        (
            (worlds, *_where(cell), cell.row.planner, *index, *(f"{value:.6g}" for value in row))
            for cell, result in found
            for index, row in result.missions(metrics)
        ),
    )


def main(flags: Standardised, base: Scenario | None = None) -> int:
    """Fill the table and write its files; gives the exit code."""
    try:
        every = list(cells(flags, base))
        fill(every, flags.out, lambda line: print(line, file=sys.stderr, flush=True))
        found = read(every, flags.out)
        write_atomic(flags.out / "standardised.md", table(found) + "\n")
        write_atomic(flags.out / "standardised.csv", tidy(found, flags.worlds))
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
