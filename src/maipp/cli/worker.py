"""`maipp worker ADDRESS`: the cores of this machine work for a cluster."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.bench.sweep.address import read_address
from maipp.bench.sweep.cluster_worker import serve_workers
from maipp.cli.notes import notes_console
from maipp.devices import keep_compiled
from maipp.errors import InputError


@dataclass(frozen=True)
class WorkerFlags:
    """Work for the scheduler at an address until it ends: a process for each core, replaced when it dies."""

    address: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ADDRESS")]
    """of the scheduler: tcp://HOST:8786 or tls://HOST:8786"""

    workers: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """processes; left out: one per core, fewer where memory is short"""

    tls: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="")] = None
    """folder of certificates, for an address that begins with tls://"""

    patience: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 60.0
    """how long to wait for the scheduler"""


def run(flags: WorkerFlags) -> int:
    """Work. Raises `InputError` for what is wrong."""
    from maipp.bench.sweep.local import workers_that_fit
    from maipp.cli.sweep_flags import check_patience

    address = read_address(flags.address, "ADDRESS")
    if flags.workers is not None and flags.workers < 1:
        raise InputError(f"--workers: {flags.workers} is too few; give a whole number >= 1")
    check_patience(flags.patience)
    workers = workers_that_fit() if flags.workers is None else flags.workers
    keep_compiled()
    notes = notes_console()
    serve_workers(address, workers, flags.tls, flags.patience, lambda line: notes.print(line, markup=False))
    return 0
