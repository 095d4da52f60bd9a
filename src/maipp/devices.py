"""Use every core: one JAX device per CPU core, so that missions shard over cores as they do over accelerators."""

import math
import os

from maipp.cgroup import cpu_quota

# XLA's thread pool has one thread per core. With as many devices as threads all of them can end up waiting for each
# other (seen with jaxlib 0.10: missions on two devices never returned with two threads, and did with three). Training
# sums over devices: there is room for one more waiting thread each. More gained nothing. XLA reads NPROC.
_THREADS_PER_DEVICE, _SPARE_THREADS = 2, 1

# Each device already keeps a core busy: letting matrix products spread over all cores only adds waiting, and so does
# cutting small loops into one piece per thread.
_FLAGS = ("--xla_cpu_multi_thread_eigen=false", "--xla_disable_hlo_passes=cpu-parallel-task-assigner")

_configured = False


def use_all_cores(cores: int | None = None) -> None:
    """Make JAX show one CPU device per core; must run before JAX touches a device, and does nothing the second time.

    An accelerator, where JAX finds one, stays the default backend. `cores` defaults to `core_count()`.
    """
    global _configured
    if _configured:
        return
    if cores is None:
        cores = core_count()
    # A device alone waits for no other, and with one thread its work does not wander between threads.
    threads = 1 if cores == 1 else _THREADS_PER_DEVICE * cores + _SPARE_THREADS
    os.environ["NPROC"] = str(max(_whole(os.environ.get("NPROC", "")), threads))
    # The Cholesky factors come from OpenBLAS, whose own threads would spin against the devices (measured: 12 times
    # slower). It reads this when it is loaded, so it works for the command line, and for a library user who calls
    # this function before importing SciPy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    flags = os.environ.get("XLA_FLAGS", "")
    added = [flag for flag in _FLAGS if flag.split("=")[0] not in flags]
    os.environ["XLA_FLAGS"] = " ".join([flags, *added]).strip()
    import jax

    jax.config.update("jax_num_cpu_devices", cores)
    _configured = True


def use_one_core(core: int | None = None) -> None:
    """Make this process work on one core, `core` where it is given and the system can; before JAX touches a device.

    For processes that share a machine, one per core: each is quicker than its share of one process on all cores, as
    its work never wanders to another core.
    """
    if core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    os.environ["NPROC"] = "0"  # what a parent process asked for is for all its cores
    use_all_cores(1)


def cores_here() -> list[int]:
    """The cores that this process may use, by their numbers."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def core_count() -> int:
    """How many cores this process may keep busy: those it may use, or fewer where a container has a quota of time."""
    quota = cpu_quota()
    cores = len(cores_here())
    return cores if quota is None else max(1, min(cores, math.ceil(quota)))


def _whole(text: str) -> int:
    """The number that a variable of the environment holds; 0 where it holds none."""
    return int(text) if text.strip().isdecimal() else 0


def missions_devices() -> list:
    """The devices that missions shard over: all local ones, but a single CPU device unless `use_all_cores` ran."""
    import jax

    devices = jax.local_devices()
    return devices if _configured or devices[0].platform != "cpu" else devices[:1]
