"""`maipp scheduler`: where the workers of a cluster and those who have work for them meet."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.bench.sweep.address import PORT, read_address
from maipp.bench.sweep.cluster_worker import serve_scheduler
from maipp.cli.notes import notes_console


@dataclass(frozen=True)
class SchedulerFlags:
    """Be the scheduler of a cluster until interrupted."""

    address: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ADDRESS")] = f"tcp://127.0.0.1:{PORT}"
    """of this machine, as others reach it: tcp://HOST:8786 or tls://HOST:8786"""

    tls: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="")] = None
    """folder of certificates, for an address that begins with tls://"""


def run(flags: SchedulerFlags) -> int:
    """Schedule. Raises `InputError` for what is wrong."""
    notes = notes_console()
    address = read_address(flags.address, "ADDRESS")
    serve_scheduler(address, flags.tls, lambda line: notes.print(line, markup=False))
    return 0
