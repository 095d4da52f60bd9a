"""The files of `maipp benchmark latency`: Markdown and JSON."""

import json
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from maipp.benchmarks.latency_run import latency_json, latency_table, measure_latency
from maipp.benchmarks.machine import machine, made_on, versions, wall_time
from maipp.benchmarks.table_rows import Row
from maipp.benchmarks.tables import TABLES
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.scenario import Scenario


@dataclass(frozen=True)
class LatencyPlan:
    """What to time."""

    scenario: Scenario = Scenario()
    rows: tuple[Row, ...] = TABLES["table1"].chosen(())
    decisions: int = 300  # at batch 1, at least
    batch: int = 64  # missions
    seed: int = 0


def write_latency(plan: LatencyPlan, folder: Path, told: Callable[[str], None] = lambda _: None) -> list[Path]:
    """Time every row, and write latency.json and latency.md after each, so that an interrupt keeps what is done.

    Raises `InputError` where a file cannot be written.
    """
    begun = time.perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror or error}") from error
    about = {"scenario": plan.scenario.to_dict(), "seed": plan.seed, "machine": machine(), "versions": versions()}
    found, paths = [], [folder / "latency.json", folder / "latency.md"]
    for row in plan.rows:
        told(f"timing {row.name}")
        size, seed = plan.decisions, plan.seed
        found.append(measure_latency(row, plan.scenario, decisions=size, batch=plan.batch, seed=seed))
        write_atomic(paths[0], json.dumps(latency_json(found, about), indent=1) + "\n")
        done = plan.rows[: len(found)]
        page = [
            _notes(plan),
            latency_table(found),
            f"```sh\n{command(plan, done, folder.name)}\n```",
            f"Made on {made_on(machine(), versions())}.",
            wall_time(time.perf_counter() - begun, "all of it; the times above do not regenerate to the last digit"),
        ]
        write_atomic(paths[1], "\n\n".join(page) + "\n")
    return paths


def command(plan: LatencyPlan, rows: Sequence[Row], out: str) -> str:
    """The command that times these rows."""
    usual, words = LatencyPlan(), ["maipp", "benchmark", "latency", "--out", out]
    for name in ("decisions", "batch", "seed"):
        given = getattr(plan, name)
        words += [f"--{name}", str(given)] if given != getattr(usual, name) else []
    for name in ("agents", "budget"):
        given = getattr(plan.scenario, name)
        words += [f"--{name}", f"{given:g}"] if given != getattr(usual.scenario, name) else []
    words += ["--planners", *(row.name for row in rows)] if len(rows) < len(usual.rows) else []
    return shlex.join(words)


def _notes(plan: LatencyPlan) -> str:
    scenario = plan.scenario
    return (
        f"{scenario.agents} agents, budget {scenario.budget:g}. Median, p95 and p99: single decisions from observing "
        f"to the waypoints, one after the other on one core, at least {plan.decisions} of them, compilation apart. "
        f"Batch: {plan.batch} missions from start to end on all devices."
    )
