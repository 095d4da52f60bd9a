"""The workers and the scheduler of a cluster, as processes of this machine."""

import asyncio
import os
import platform
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from maipp.bench.sweep.address import UNPROTECTED, Address, quiet, security
from maipp.devices import cores_here, use_one_core
from maipp.errors import InputError, first_line

# A compilation holds Python's lock, and with it the worker's heartbeat, for minutes; and a worker that dies counts
# against every job that it was given.
SCHEDULER_SETTINGS = {
    "distributed.scheduler.worker-ttl": "30 minutes",
    "distributed.scheduler.allowed-failures": 10,
    "distributed.scheduler.http.routes": [],  # pages that nothing protects
}
_WORKER_SETTINGS = {
    "distributed.worker.multiprocessing-method": "spawn",  # JAX does not survive a fork
    "distributed.worker.http.routes": [],
    "distributed.worker.profile.enabled": False,  # it would look at what the worker does a hundred times a second
}


_NO_PAGES: dict[str, Any] = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
_CORE = "MAIPP_WORKER_CORE"  # variable of a worker's environment: the number of its core


def dask_setup(worker: Any) -> None:
    """What `distributed` calls in a worker's process before it has imported JAX: it takes its core for itself."""
    core = os.environ.get(_CORE)
    use_one_core(int(core) if core else None)


def serve_workers(
    address: Address, workers: int, tls: Path | None, patience: float, told: Callable[[str], None]
) -> None:
    """Work for the scheduler until it ends: so many processes, each with a nanny that replaces it when it dies.

    Raises `InputError` where no scheduler answers for `patience` seconds.
    """
    protection = security(address.scheme, tls)
    if not address.protected:
        told(UNPROTECTED.format(address))
    # Only as many workers as cores have a core each: others on this machine may be at work as well.
    cores = cores_here() if workers == len(cores_here()) else [None] * workers
    quiet()
    asyncio.run(_work(address, cores, protection, patience, told))


async def _work(
    address: Address, cores: list[Any], protection: Any, patience: float, told: Callable[[str], None]
) -> None:
    from dask import config
    from distributed import Nanny
    from distributed.core import Status

    await _answered(address, protection, patience)
    with tempfile.TemporaryDirectory(prefix="maipp-worker-") as folder, config.set(_WORKER_SETTINGS):
        common: dict[str, Any] = {"nthreads": 1, "memory_limit": 0, "security": protection, **_NO_PAGES}
        common |= {"preload": [__name__], "local_directory": folder, "host": address.host if address.loopback else None}
        nannies = [
            Nanny(str(address), name=f"{platform.node()}-{os.getpid()}-{i}", env=_environment(core), **common)
            for i, core in enumerate(cores)
        ]
        try:
            try:
                await asyncio.gather(*nannies)
            except (OSError, TimeoutError, RuntimeError) as error:
                cause = error.__cause__ if isinstance(error.__cause__, Exception) else error
                raise InputError(f"ADDRESS: no worker for {address} can be started: {first_line(cause)}") from None
            told(f"{len(nannies)} workers for {address}")
            await asyncio.gather(*(nanny.finished() for nanny in nannies))
            told(f"the scheduler at {address} has ended, and so have its workers")
        finally:
            await asyncio.gather(*(nanny.close() for nanny in nannies if nanny.status != Status.closed))


def _environment(core: int | None) -> dict[str, str]:
    return {} if core is None else {_CORE: str(core)}


async def _answered(address: Address, protection: Any, patience: float) -> None:
    """Wait for the scheduler. Raises `InputError` where it does not answer in time."""
    from distributed.comm.core import connect

    arguments = protection.get_connection_args("worker") if protection is not None else {}
    try:
        comm = await connect(str(address), timeout=patience, **arguments)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"ADDRESS: no scheduler answers at {address} for {patience:g} s ({first_line(error)}); start one with: "
            "maipp scheduler"
        ) from None
    comm.abort()


def serve_scheduler(address: Address, tls: Path | None, told: Callable[[str], None]) -> None:
    """Be the scheduler at an address of this machine until interrupted. Raises `InputError` where it is taken."""
    protection = security(address.scheme, tls)
    if not address.protected:
        told(UNPROTECTED.format(address))
    quiet()
    asyncio.run(_schedule(address, protection, told))


async def _schedule(address: Address, protection: Any, told: Callable[[str], None]) -> None:
    from dask import config
    from distributed import Scheduler

    host = address.host.strip("[]")
    with config.set(SCHEDULER_SETTINGS):
        try:
            async with Scheduler(
                host=host, port=address.port, protocol=address.scheme, security=protection, **_NO_PAGES
            ) as scheduler:
                told(f"scheduler at {scheduler.address}; workers: maipp worker {scheduler.address}")
                await scheduler.finished()
        except (OSError, RuntimeError) as error:
            cause = error.__cause__ if isinstance(error.__cause__, Exception) else error
            raise InputError(f"ADDRESS: {address}: cannot listen there: {first_line(cause)}") from None
