"""The flags of commands whose work can be shared by many processes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from maipp.errors import InputError

if TYPE_CHECKING:  # it imports JAX, which the help of a command can do without
    from maipp.bench.sweep.dealing import Where


@dataclass(frozen=True, kw_only=True)
class SweepFlags:
    """Where the work is done."""

    workers: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """processes on this machine, a core each, 0 for this one alone on all devices; left out: one per core, fewer where
    memory is short, and 0 where there is an accelerator"""

    cluster: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """scheduler of a cluster whose workers do the work, such as tcp://127.0.0.1:8786 (docs/cluster.md)"""

    tls: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="")] = None
    """folder of certificates, for an address that begins with tls://"""

    patience: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 60.0
    """how long to go on without a worker, or a word of the scheduler"""

    def where(self) -> "Where":
        """Where the work is done. Raises `InputError` for what is wrong."""
        from maipp.bench.sweep.address import read_address, security
        from maipp.bench.sweep.dealing import Where

        if self.workers is not None and self.workers < 0:
            raise InputError(f"--workers: {self.workers} is negative; give a whole number >= 0")
        if self.cluster is None and self.tls is not None:
            raise InputError("--tls: goes with --cluster tls://...; give both, or neither")
        if self.cluster is not None and self.workers is not None:
            raise InputError("--workers: a cluster's workers are told there how many they are; leave --workers out")
        check_patience(self.patience)
        if self.cluster is not None:
            security(read_address(self.cluster, "--cluster").scheme, self.tls)
        return Where(self.workers, self.cluster, self.tls, self.patience)


def check_patience(seconds: float) -> None:
    """Raise `InputError` for a number of seconds that nobody can wait."""
    if not 0 < seconds < float("inf"):
        raise InputError(f"--patience: {seconds:g} is no time to wait; give a number of seconds > 0")
