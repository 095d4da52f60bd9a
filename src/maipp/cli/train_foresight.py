"""`maipp train foresight`: train the network that foresees the field into a folder, or go on with the run it holds."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from maipp.bench.provenance import machine, versions
from maipp.cli.run_flags import RunFlags
from maipp.cli.train import INTERRUPTED
from maipp.foresight.shipped import FINAL
from maipp.training.config_io import ConfigKind
from maipp.training.foresight.config import NAMED
from maipp.training.foresight.run import FitResult, FitStep, train_foresight
from maipp.training.training_log import LOG

_FORESIGHT = ConfigKind(NAMED, "docs/training-keys.md")
_LINE_SECONDS = 30.0  # between two lines about updates


@dataclass(frozen=True)
class TrainForesightFlags(RunFlags):
    """Train the network that foresees the field; its weights, log and checkpoints go into a folder."""


def run(flags: TrainForesightFlags) -> int:
    """Train; gives 130 when interrupted. Raises `InputError` for what is wrong, and when training diverges."""
    config = flags.configuration(_FORESIGHT)
    notes = Console(stderr=True, highlight=False, soft_wrap=True)
    about = {"machine": machine(), "versions": versions()}
    with _shown(notes) as progress:
        result = train_foresight(
            config, flags.out, resume=flags.resume, progress=progress, tell=notes.print, about=about
        )
    _report(result, flags.out, notes)
    return INTERRUPTED if result.interrupted else 0


@contextmanager
def _shown(notes: Console) -> Iterator[Any]:
    """What to call after each step: a line now and then, and one for each evaluation."""
    last = time.monotonic() - _LINE_SECONDS

    def show(step: FitStep) -> None:
        nonlocal last
        if (found := step.evaluation) is not None:
            notes.print(
                f"update {step.update}: RMSE {found['learned_rmse']:.4f}, fitted {found['fitted_rmse']:.4f}, "
                f"belief {found['belief_rmse']:.4f}; NLL {found['learned_nll']:.3f}, fitted {found['fitted_nll']:.3f}"
            )
        elif time.monotonic() - last >= _LINE_SECONDS:
            last = time.monotonic()
            notes.print(f"update {step.update} of {step.updates}, {step.wall_s:.0f} s: loss {step.metrics['loss']:.3f}")

    yield show


def _report(result: FitResult, out: Path, notes: Console) -> None:
    """What was written, and how it went."""
    record = result.record
    if result.interrupted:
        notes.print(f"interrupted after update {record.update}; --resume goes on from it")
        return
    print(f"{record.update} updates, {record.transitions} samples, {record.wall_s:.0f} s")
    for name in (FINAL, LOG):
        print(f"wrote {out / name}")
