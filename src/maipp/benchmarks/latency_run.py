"""How fast planners decide: one at a time on one core, and in batches on all devices."""

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from maipp.benchmarks.latency import first_decision_seconds
from maipp.benchmarks.table_rows import Row
from maipp.devices import missions_devices
from maipp.engine import draw_missions, run_missions
from maipp.planners import make_planner
from maipp.scenario import Scenario


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
    _pin(tasks, {min(before)})
    try:
        yield
    finally:
        _pin(tasks, before)


def measure_latency(row: Row, scenario: Scenario, *, decisions: int, batch: int, seed: int) -> Latency:
    """Time a row: at least `decisions` single decisions, and a batch of missions."""
    planner = make_planner(row.planner, scenario, row.options)
    missions = draw_missions(
        scenario,
        seed=seed,
        instances=batch,
        planner=planner,
    )
    key = jax.random.key(seed)
    with one_core():
        first, seconds = first_decision_seconds(planner, missions, key, least=decisions)
    taken, (cold, warm) = 0, (0.0, 0.0)
    for number in range(2):
        begun = time.perf_counter()
        taken = int(np.asarray(run_missions(planner, missions, key).events).sum())
        cold, warm = (time.perf_counter() - begun, warm) if number == 0 else (cold, time.perf_counter() - begun)
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


def latency_table(found: Sequence[Latency]) -> str:
    """Markdown: a line per row."""
    lines = [
        "| row | median, ms | p95, ms | p99, ms | compile, s | decisions/s in a batch | compile of the batch, s |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for one in found:
        times = (one.median_ms, one.p95_ms, one.p99_ms, one.compile_s)
        cells = [f"`{one.row}`", *map(_three, times), f"{one.per_second:,.0f}", _three(one.batch_compile_s)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def latency_json(found: Sequence[Latency], about: Mapping[str, Any]) -> dict[str, Any]:
    """Everything as plain JSON."""
    return {"format": "maipp-latency", **about, "rows": [asdict(one) for one in found]}


def _three(value: float) -> str:
    return f"{value:#.3g}".rstrip(".")


def _pin(tasks: Path, cores: set[int]) -> None:
    for task in tasks.iterdir():
        try:
            os.sched_setaffinity(int(task.name), cores)
        except OSError:  # the thread has ended meanwhile
            continue
