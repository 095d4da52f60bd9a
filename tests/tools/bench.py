"""`python -m tests.tools.bench`: time of a decision on one core, alone and in a batch (`make bench`).

The times are compared, as multiples of a fixed kernel, with those in `baseline.json`.
"""

import os
import statistics
import sys
import timeit
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import tyro
from rich import box
from rich.console import Console
from rich.table import Table

from maipp.bench.provenance import machine, versions
from maipp.devices import use_all_cores
from maipp.errors import InputError
from tests.tools.baseline import BASELINE, compare, kernel_seconds, load_baseline, save_baseline, slower

PLANNERS = ("lawnmower", "greedy", "shared-greedy", "sga-rrt", "receding-horizon")

# Measured with the public implementation of the paper, on one comparable core.
PUBLIC_SGA_RRT_PLAN_S = 0.6
PUBLIC_EPISODE_S = (21.0, 28.0)  # three agents

# A batch that takes longer than this has long averaged over its noise: it is not repeated.
_SLOW_BATCH_S = 40.0


@dataclass(frozen=True)
class Bench:
    """Time each planner on one core: compilation excluded, medians, the paper's scenario (3 agents, budget 3)."""

    planner: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PLANNER [PLANNER ...]", help_behavior_hint="")] = (
        PLANNERS
    )
    """planners to time; all of them if left out"""

    quick: bool = False
    """a tenth of the missions, one repetition"""

    missions: int = 300
    """missions in the batch"""

    repeat: int = 3
    """repetitions of the batch, where it takes less than 40 s"""

    baseline: Path = BASELINE
    """file of the times to compare with"""

    update: bool = False
    """keep the times of this run as the baseline"""

    strict: bool = False
    """exit with code 1 where a time has grown beyond the tolerance"""

    tolerance: float = 1.25
    """growth of a time, as a multiple of the kernel's, that is still noise"""


class Timing(NamedTuple):
    """Times of one planner."""

    planner: str
    decision_ms: float  # median of single decisions from the host
    decision_p95_ms: float
    episode_ms: float  # one mission from start to end
    batch_decision_us: float  # per decision, all missions of the batch together
    batch_episode_ms: float  # per mission of the batch

    def multiples(self, kernel_s: float) -> dict[str, float]:
        """What is compared with the baseline: the hot paths, as multiples of a kernel's seconds."""
        alone, batched = self.decision_ms / 1e3, self.batch_decision_us / 1e6
        seconds = {"decision": alone, "episode": self.episode_ms / 1e3, "batched decision": batched}
        return {path: time / kernel_s for path, time in seconds.items()}


def pin_to_one_core() -> None:
    """Keep this process on the first core it may use, where the system can: numbers of different machines compare."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def time_planner(name: str, scenario: Any, *, missions: int, repeat: int) -> Timing:
    """The times of one planner on a scenario, compilation excluded."""
    import jax

    from maipp.bench.tables import Row
    from maipp.engine import run_missions
    from maipp.engine.decision_time import decision_time

    planner, batch = Row(name, name).drawn(scenario, instances=missions, seed=0)
    single = jax.tree.map(lambda array: array[:1], batch)
    key = jax.random.key(0)

    def run(drawn: Any) -> Any:
        return jax.block_until_ready(run_missions(planner, drawn, key))

    begun = timeit.default_timer()
    decisions = int(run(batch).events.sum())  # compiles; so does the next line
    if timeit.default_timer() - begun > _SLOW_BATCH_S:
        repeat = 1
    run(single)
    alone = decision_time(planner, batch, key)
    batch_s = statistics.median(timeit.repeat(lambda: run(batch), number=1, repeat=repeat))
    single_s = statistics.median(timeit.repeat(lambda: run(single), number=1, repeat=3 * repeat))
    return Timing(name, alone.median, alone.p95, 1e3 * single_s, 1e6 * batch_s / decisions, 1e3 * batch_s / missions)


def main(bench: Bench) -> int:
    """Time the planners, print the tables, compare with the baseline; 1 where --strict finds something slower.

    Raises `InputError` for a bad baseline.
    """
    before = load_baseline(bench.baseline)
    pin_to_one_core()
    use_all_cores()
    from maipp.scenario import Scenario

    missions, repeat = (max(bench.missions // 10, 1), 1) if bench.quick else (bench.missions, bench.repeat)
    console = Console(highlight=False)
    here, releases = machine(), versions()
    console.print(
        f"{here['cpu']}, {here['cores']} core used, {here['backend']}, {here['precision']}, "
        f"jax {releases['jax']}, python {releases['python']}"
    )
    timings, hot = [], {}
    kernel_s = kernel_seconds()
    for name in bench.planner:
        timing = time_planner(name, Scenario(), missions=missions, repeat=repeat)
        timings.append(timing)
        console.print(f"timed {name}", style="dim")
        # The kernel before and after: a machine that grows busy meanwhile slows both.
        previous, kernel_s = kernel_s, kernel_seconds()
        hot[name] = timing.multiples((previous + kernel_s) / 2)
    headings = ("planner", "decision ms", "p95 ms", "episode ms", "batched decision us", "batched episode ms")
    lines = [[timing.planner, *(f"{value:,.2f}" for value in timing[1:])] for timing in timings]
    whole = _table(f"medians; batch of {missions} missions", headings, lines)
    console.print(whole, width=None if console.is_terminal else 100)
    for timing in timings:
        if timing.planner == "sga-rrt":
            console.print(_against_public(timing))
    rows = compare(hot, before)
    title = "times as multiples of a fixed kernel; change: to the baseline"
    lines = []
    for row in rows:
        known = ("-", "-") if row.before is None else (f"{row.before:.3g}", f"{row.change:.2f}")
        lines.append([row.planner, row.path, f"{row.multiple:.3g}", *known])
    console.print(_table(title, ("planner", "path", "multiple", "baseline", "change"), lines, left=2))
    if bench.update:
        save_baseline(hot, bench.baseline)
        console.print(f"wrote {bench.baseline}")
    grown = slower(rows, bench.tolerance)
    for row in grown:
        console.print(f"slower: {row.planner}, {row.path}: {row.change:.2f} times the baseline")
    return int(bench.strict and bool(grown))


def _against_public(timing: Timing) -> str:
    """How SGA+RRT compares with the public implementation."""
    plan = 1e3 * PUBLIC_SGA_RRT_PLAN_S
    low, high = (1e3 * seconds for seconds in PUBLIC_EPISODE_S)
    alone, batched = timing.episode_ms, timing.batch_episode_ms
    return (
        f"SGA+RRT by the public implementation: {plan:g} ms a plan, {low / 1e3:g}-{high / 1e3:g} s an episode\n"
        f"a plan here:     {plan / timing.decision_ms:,.0f} times faster alone, "
        f"{1e3 * plan / timing.batch_decision_us:,.0f} times in the batch\n"
        f"an episode here: {low / alone:,.0f}-{high / alone:,.0f} times faster alone, "
        f"{low / batched:,.0f}-{high / batched:,.0f} times in the batch"
    )


def _table(title: str, headings: Sequence[str], lines: Iterable[Sequence[str]], left: int = 1) -> Table:
    """A table whose first `left` columns are words, the others numbers."""
    table = Table(title=title, box=box.SIMPLE_HEAD)
    for number, heading in enumerate(headings):
        table.add_column(heading, no_wrap=number < left, justify="left" if number < left else "right")
    for line in lines:
        table.add_row(*line)
    return table


if __name__ == "__main__":
    try:
        sys.exit(main(tyro.cli(Bench, prog="python -m tests.tools.bench")))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
