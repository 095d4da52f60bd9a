"""Use every core: one JAX device per CPU core, so that missions shard over cores as they do over accelerators."""

import math
import os
import sys
from pathlib import Path
from typing import Any

from maipp.cgroup import cpu_quota
from maipp.errors import InputError

# XLA's thread pool has one thread per core. With as many devices as threads all of them can end up waiting for each
# other (seen with jaxlib 0.10: missions on two devices never returned with two threads, and did with three). Training
# sums over devices: there is room for one more waiting thread each. More gained nothing. XLA reads NPROC.
_THREADS_PER_DEVICE, _SPARE_THREADS = 2, 1

# Each device already keeps a core busy: letting matrix products spread over all cores only adds waiting, and so does
# cutting small loops into one piece per thread.
_FLAGS = ("--xla_cpu_multi_thread_eigen=false", "--xla_disable_hlo_passes=cpu-parallel-task-assigner")

_configured = False
_forked = False  # this process was forked off one in which JAX had started


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


def cache_folder() -> Path | None:
    """Where compiled programs are kept: `MAIPP_CACHE` (None if it is empty), else below the user's cache folder."""
    chosen = os.environ.get("MAIPP_CACHE")
    if chosen is not None:
        return Path(chosen) if chosen else None
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "maipp"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "maipp" / "Cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "maipp"


def keep_compiled() -> None:
    """Keep compiled programs in `cache_folder` between runs, of this process from now on, and of those that it starts.

    What is set for JAX itself wins. The command line and the environments do so by themselves.
    """
    folder = cache_folder()
    if folder is None:
        return
    # JAX reads both when it is imported.
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")  # else not worth reading
    jax: Any = sys.modules.get("jax")
    if jax is None or jax.config.jax_compilation_cache_dir:
        return
    jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    seconds = float(os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", seconds)
    from jax.experimental.compilation_cache import compilation_cache

    compilation_cache.reset_cache()  # JAX looks for a folder once, at its first compilation


def _note_fork() -> None:
    """In a child: whether JAX's threads, which no child has, were there already."""
    global _forked
    bridge = sys.modules.get("jax._src.xla_bridge")  # JAX itself warns of such a fork by the same question
    _forked = _forked or bool(bridge and getattr(bridge, "backends_are_initialized", lambda: False)())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_fork)


def refuse_fork() -> None:
    """Raise InputError where this process was forked after JAX had started: whatever it computed would never end."""
    if _forked:
        raise InputError(
            "this process was forked after JAX had started, and would wait for JAX for ever; start workers by "
            "'spawn' or 'forkserver': multiprocessing.get_context('spawn'), start_method='spawn'"
        )
