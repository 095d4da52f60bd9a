"""`maipp benchmark latency`: how fast planners decide, one at a time on one core, and in batches on all devices."""

import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax
import numpy as np
import pandas as pd

from maipp.bench.command import command, flags_of, footer, wall_time
from maipp.bench.page import markdown
from maipp.bench.provenance import machine, versions
from maipp.bench.tables import TABLES, Row
from maipp.devices import missions_devices
from maipp.engine import run_missions
from maipp.engine.decision_time import decision_seconds
from maipp.files import make_folder, write_atomic
from maipp.markdown import three
from maipp.scenario import Scenario


@dataclass(frozen=True)
class LatencyPlan:
    """What to time."""

    scenario: Scenario = Scenario()
    rows: tuple[Row, ...] = TABLES["table1"].chosen(())
    decisions: int = 300  # at batch 1, at least
    batch: int = 64  # missions
    seed: int = 0


@dataclass(frozen=True)
class Latency:
    """The times of one row."""

    row: str
    median_ms: float  # of single decisions at batch 1 on one core
    p95_ms: float
    p99_ms: float
    decisions: int  # that these are of
    compile_s: float  # the first decision at batch 1, less the median
    batch: int  # missions run together
    batch_compile_s: float  # the first run of the batch, less the second
    per_second: float  # decisions a second in the batch, on all devices
    devices: int


@contextmanager
def one_core() -> Iterator[None]:
    """Keep all threads of this process on the first core it may use, where the system can, until the block ends."""
    tasks = Path("/proc/self/task")
    if not (hasattr(os, "sched_setaffinity") and tasks.is_dir()):
        yield
        return
    before = os.sched_getaffinity(0)

    def pin(cores: set[int]) -> None:
        for task in tasks.iterdir():
            with suppress(OSError):  # the thread has ended meanwhile
                os.sched_setaffinity(int(task.name), cores)

    pin({min(before)})
    try:
        yield
    finally:
        pin(before)


def measure_latency(row: Row, scenario: Scenario, *, decisions: int, batch: int, seed: int) -> Latency:
    """Time a row: at least `decisions` single decisions, and a batch of missions."""
    planner, missions = row.drawn(scenario, instances=batch, seed=seed)
    key = jax.random.key(seed)
    with one_core():
        first, seconds = decision_seconds(planner, missions, key, least=decisions)

    def run() -> tuple[float, int]:
        """Seconds that the batch takes, and its decisions."""
        begun = time.perf_counter()
        taken = int(np.asarray(run_missions(planner, missions, key).events).sum())
        return time.perf_counter() - begun, taken

    (cold, _), (warm, taken) = run(), run()
    median, p95, p99 = (float(np.percentile(seconds, q)) for q in (50, 95, 99))
    return Latency(
        row=row.name,
        median_ms=1e3 * median,
        p95_ms=1e3 * p95,
        p99_ms=1e3 * p99,
        decisions=len(seconds),
        compile_s=max(first - median, 0.0),
        batch=batch,
        batch_compile_s=max(cold - warm, 0.0),
        per_second=taken / warm,
        devices=min(len(missions_devices()), batch),
    )


_COLUMNS = {
    "row": "`{row}`",
    "median, ms": "{median_ms}",
    "p95, ms": "{p95_ms}",
    "p99, ms": "{p99_ms}",
    "compile, s": "{compile_s}",
    "decisions/s in a batch": "{per_second:,.0f}",
    "compile of the batch, s": "{batch_compile_s}",
}


def latency_table(found: Sequence[Latency]) -> str:
    """Markdown: a line per row."""
    frame = pd.DataFrame(found)
    times = {name: frame[name].map(three) for name in frame if str(name).endswith(("_ms", "_s"))}
    return markdown(frame.assign(**times), _COLUMNS)


_ALL = "all of it; the times above do not regenerate to the last digit"


def write_latency(plan: LatencyPlan, folder: Path, told: Callable[[str], None] = lambda _: None) -> list[Path]:
    """Time every row, and write latency.json and latency.md after each, so that an interrupt keeps what is done.

    Raises `InputError` where a file cannot be written.
    """
    begun = time.perf_counter()
    make_folder(folder)
    here = machine(), versions()
    about = {"scenario": plan.scenario.to_dict(), "seed": plan.seed, "machine": here[0], "versions": here[1]}
    found, paths = [], [folder / "latency.json", folder / "latency.md"]
    for row in plan.rows:
        told(f"timing {row.name}")
        size, seed = plan.decisions, plan.seed
        found.append(measure_latency(row, plan.scenario, decisions=size, batch=plan.batch, seed=seed))
        document = {"format": "maipp-latency", **about, "rows": [asdict(one) for one in found]}
        write_atomic(paths[0], json.dumps(document, indent=1) + "\n")
        seconds = time.perf_counter() - begun
        blocks = [
            _notes(plan),
            latency_table(found),
            *footer(typed(plan, plan.rows[: len(found)], folder.name), [here], wall_time(seconds, _ALL)),
        ]
        write_atomic(paths[1], "\n\n".join(blocks) + "\n")
    return paths


def typed(plan: LatencyPlan, rows: Sequence[Row], out: str) -> str:
    """The command that times these rows."""
    given, usual = (flags_of(each, "agents", "budget") for each in (replace(plan, rows=tuple(rows)), LatencyPlan()))
    return command("latency", out, given, usual)


def _notes(plan: LatencyPlan) -> str:
    scenario = plan.scenario
    return (
        f"{scenario.agents} agents, budget {scenario.budget:g}. Median, p95 and p99: single decisions from observing "
        f"to the waypoints, one after the other on one core, at least {plan.decisions} of them, compilation apart. "
        f"Batch: {plan.batch} missions from start to end on all devices."
    )
