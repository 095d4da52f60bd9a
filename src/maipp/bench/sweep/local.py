"""The processes of this machine that work on a sweep, a core each."""

import multiprocessing
import os
from collections import Counter
from collections.abc import Collection, Hashable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any

import jax

from maipp.bench.sweep.jobs import LOST, Job, answer, asked, begin
from maipp.cgroup import memory_limit
from maipp.devices import core_count, cores_here
from maipp.errors import InputError

MOST_DEATHS = 3  # of the processes that do one job
_MEMORY_OF_ONE = 2 << 30  # bytes that a worker may come to need: 1.4 GB was seen, most of it to compile


def default_workers() -> int:
    """One per core, fewer where memory would not do; none where JAX has an accelerator."""
    return workers_that_fit() if jax.default_backend() == "cpu" else 0


def workers_that_fit() -> int:
    """One per core, fewer where memory would not do."""
    limit = memory_limit()
    memory = [] if limit is None else [limit]
    with suppress(AttributeError, ValueError, OSError):  # where the system does not tell
        memory.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return max(1, min([core_count(), *(size // _MEMORY_OF_ONE for size in memory)]))


def pinned_cores() -> list[int | None]:
    """The cores that workers are pinned to in turn; only None where there is a quota of time, not cores of one's own:
    the system then chooses the idle ones."""
    cores: list[int | None] = [*cores_here()]
    return cores if core_count() >= len(cores) else [None]


class _CoreProcess:
    """A core with one process on it: a pool of one, so that the death of a process is that of its own job only."""

    def __init__(self, core: int | None) -> None:
        self.core = core
        context = multiprocessing.get_context("spawn")  # JAX does not survive a fork
        self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=begin, initargs=(core,))
        self._process: Any = None

    def submit(self, job: Job) -> Future:
        """Have the process do a job; the first one starts it."""
        before = set(multiprocessing.active_children())
        future = self._pool.submit(answer, asked(job))
        if self._process is None:
            (self._process,) = set(multiprocessing.active_children()) - before
        return future

    def end(self) -> int:
        """End the process where it still runs; gives its exit code, negative for a signal."""
        if self._process is not None:
            self._process.terminate()
        self._pool.shutdown(cancel_futures=True)
        return 0 if self._process is None else self._process.exitcode or 0


class Processes:
    """A crew of processes of this machine. A process that is killed is replaced, and what it did is done again."""

    def __init__(self, workers: int) -> None:
        cores = pinned_cores()
        self._lanes = [_CoreProcess(cores[i % len(cores)]) for i in range(workers)]
        self._at: dict[Future, tuple[_CoreProcess, int, Job]] = {}
        self._deaths: Counter[int] = Counter()  # by the number of the job

    def free(self) -> Collection[Hashable]:
        """The lanes that have nothing to do."""
        busy = {lane for lane, *_ in self._at.values()}
        return [lane for lane in self._lanes if lane not in busy]

    def give(self, seat: Hashable, number: int, job: Job) -> None:
        """Have a lane do a job."""
        assert isinstance(seat, _CoreProcess)
        self._at[seat.submit(job)] = seat, number, job

    def wait(self) -> Iterable[tuple[int, Any]]:
        """What jobs came to, of which there is at least one."""
        for future in wait(self._at, return_when=FIRST_COMPLETED).done:
            lane, number, job = self._at.pop(future)
            error = future.exception()
            if error is None:
                yield number, future.result()
            elif isinstance(error, BrokenProcessPool):
                yield number, self._ended(lane, number, job)
            else:
                yield number, RuntimeError(f"{job.words}: its result cannot be sent: {error}")

    def close(self) -> None:
        """End all processes."""
        for lane in self._lanes:
            lane.end()

    def _ended(self, lane: _CoreProcess, number: int, job: Job) -> Any:
        """What becomes of the job whose process is no more."""
        code = lane.end()
        who = f"--workers: the process that computed {job.words},"
        if code >= 0:
            return InputError(
                f"{who} ended by itself (exit code {code}), as its own words above say; a script that starts workers "
                'must do so under `if __name__ == "__main__":`'
            )
        self._deaths[number] += 1
        if self._deaths[number] == MOST_DEATHS:
            return InputError(
                f"{who} was ended by signal {-code}, perhaps for want of memory, and so were {MOST_DEATHS - 1} before "
                "it; the same command goes on, give fewer workers"
            )
        self._lanes[self._lanes.index(lane)] = _CoreProcess(lane.core)
        return LOST
