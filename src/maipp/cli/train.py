"""`maipp train`: train a policy into a folder, or go on with the run it holds."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from maipp.bench.provenance import machine, versions
from maipp.cli.run_flags import RunFlags
from maipp.policy.shipped import BEST
from maipp.training.config import TrainConfig
from maipp.training.config_io import POLICY
from maipp.training.curves import CURVE
from maipp.training.hosts import all_or_none, hosts_of, join_hosts
from maipp.training.train import FINAL, Step, TrainResult, train
from maipp.training.training_log import LOG

INTERRUPTED = 130
_LINE_SECONDS = 30.0  # between two lines where there is no terminal to draw a bar on


@dataclass(frozen=True)
class TrainFlags(RunFlags):
    """Train a policy; its weights, log, checkpoints and learning curve go into a folder."""

    coordinator: Annotated[str | None, tyro.conf.arg(metavar="HOST:PORT", help_behavior_hint="")] = None
    """where process 0 is reached, if several processes train together; under SLURM found by itself"""

    process_id: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """number of this process, from 0"""

    processes: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """processes in all"""


def run(flags: TrainFlags) -> int:
    """Train; gives 130 when interrupted. Raises `InputError` for what is wrong, and when training diverges."""
    processes = join_hosts(coordinator=flags.coordinator, process_id=flags.process_id, processes=flags.processes)
    config = all_or_none(lambda: flags.configuration(POLICY), processes)
    hosts = all_or_none(lambda: hosts_of(config.shards), processes)
    notes = Console(stderr=True, highlight=False, soft_wrap=True)
    about = {"machine": machine() | {"processes": hosts.processes}, "versions": versions()}
    with _shown(notes, config) as progress:
        result = train(config, flags.out, resume=flags.resume, progress=progress, hosts=hosts, about=about)
    if hosts.process == 0:
        _report(result, flags.out, notes)
    return INTERRUPTED if result.interrupted else 0


@contextmanager
def _shown(notes: Console, config: TrainConfig) -> Iterator[Callable[[Step], None]]:
    """What to call after each step: a bar on a terminal, else a line now and then; a line per evaluation."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("updates"))
    last = time.monotonic() - _LINE_SECONDS
    with Progress(
        *columns, TimeElapsedColumn(), TimeRemainingColumn(), console=notes, disable=not notes.is_terminal
    ) as bar:
        task = bar.add_task("compiling", total=config.updates)

        def show(step: Step) -> None:
            nonlocal last
            if step.held_out is not None:
                error = "" if step.held_out.se is None else f" ({step.held_out.se:.2g})"
                notes.print(f"update {step.update}: held-out Tr(P) {step.held_out.trace:.4g}{error}")
                return
            bar.update(task, completed=step.update, description=_describe(step))
            if not notes.is_terminal and time.monotonic() - last >= _LINE_SECONDS:
                last = time.monotonic()
                notes.print(f"update {step.update} of {step.updates}, {step.wall_s:.0f} s: {_describe(step)}")

        yield show


def _describe(step: Step) -> str:
    """The numbers worth a glance."""
    trace = step.metrics.get("final_trace", float("nan"))
    return f"loss {step.metrics['loss']:.3g}" + ("" if trace != trace else f", Tr(P) {trace:.3g}")


def _report(result: TrainResult, out: Path, notes: Console) -> None:
    """What was written, and how it went."""
    record = result.record
    if result.interrupted:
        notes.print(f"interrupted after update {record.update}; wrote {result.checkpoint}, --resume goes on from it")
        return
    print(f"{record.update} updates, {record.transitions} transitions, {record.wall_s:.0f} s")
    if record.best is not None:
        print(f"best held-out Tr(P): {record.best['trace']:.4g}, after update {record.best['update']}")
    for name in (BEST, FINAL, LOG, CURVE):
        print(f"wrote {out / name}")
