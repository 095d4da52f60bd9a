"""Filling a table by several processes, one per core."""

import multiprocessing
import os
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

import jax

from maipp.benchmarks.cells import Cell
from maipp.benchmarks.table_worker import Failed, Progress, work
from maipp.cgroup import memory_limit
from maipp.devices import core_count, cores_here
from maipp.errors import InputError

_MEMORY_OF_ONE = 2 << 30  # bytes that a worker may come to need: 1.4 GB was seen, most of it to compile

# Number of the cell among those to compute, and its missions done: 0 when it begins, all at last.
Tell = Callable[[int, int], None]


@dataclass
class _Worker:
    """A process, and the cell that it is at."""

    process: SpawnProcess
    channel: Connection
    number: int = -1  # of the cell it is at; -1: none


def default_workers() -> int:
    """One per core, fewer where memory would not do; none where JAX has an accelerator."""
    if jax.default_backend() != "cpu":
        return 0
    memory = _memory()
    return core_count() if memory is None else max(1, min(core_count(), memory // _MEMORY_OF_ONE))


def _memory() -> int | None:
    """Bytes that there are for this process; None where the system does not tell."""
    limit = memory_limit()
    known = [] if limit is None else [limit]
    with suppress(AttributeError, ValueError, OSError):
        known.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return min(known, default=None)


def choose(waiting: Sequence[int], kinds: Sequence[Hashable], last: Hashable, busy: Collection[Hashable]) -> int:
    """The number of the cell that a worker takes next: one of `waiting`, numbers of cells in order.

    `kinds[number]` is equal for cells that share a compilation, `last` what the worker has compiled and `busy` what
    the others have. It goes on with its kind; else it begins the first that nobody has; else it helps with what most is
    left of. Of a kind the last cell, which takes longest, comes first and helpers take the shortest, so that at the end
    nobody waits for long.
    """
    left = Counter(kinds[number] for number in waiting)
    if last in left:
        return max(number for number in waiting if kinds[number] == last)
    fresh = [kind for kind in left if kind not in busy]
    if fresh:
        return max(number for number in waiting if kinds[number] == fresh[0])
    most = max(left, key=lambda kind: left[kind])
    return min(number for number in waiting if kinds[number] == most)


def fill_by_workers(missing: Sequence[Cell], folder: Path, workers: int, tell: Tell) -> None:
    """Compute and keep the cells, each on one core: their numbers do not depend on how many workers there are.

    When this ends, however it does, no worker is left. Raises `InputError` where a cell does, and where a worker ended
    by itself or was killed.
    """
    context = multiprocessing.get_context("spawn")
    cores: list[int | None] = [*cores_here()]
    if core_count() < len(cores):  # a quota of time, not cores of one's own: the system chooses the idle ones
        cores = [None]
    kinds = [_kind(cell) for cell in missing]
    waiting = list(range(len(missing)))
    team: list[_Worker] = []

    def give(worker: _Worker) -> None:
        last = kinds[worker.number] if worker.number >= 0 else None
        others = {kinds[other.number] for other in team if other is not worker and other.number >= 0}
        worker.number = choose(waiting, kinds, last, others)
        waiting.remove(worker.number)
        tell(worker.number, 0)
        with suppress(BrokenPipeError):  # it has ended, as waiting for its answer will tell
            worker.channel.send(missing[worker.number])

    try:
        for i in range(min(workers, len(missing))):
            ours, theirs = context.Pipe()
            core = cores[i % len(cores)]
            process = context.Process(target=work, args=(theirs, folder, core), daemon=True, name=f"maipp worker {i}")
            process.start()
            theirs.close()  # so that the channel ends when the worker does
            team.append(_Worker(process, ours))
            give(team[-1])
        at_work = {worker.channel: worker for worker in team}
        while at_work:
            for channel in wait(at_work):
                assert isinstance(channel, Connection)
                worker = at_work[channel]
                answer = _receive(worker, missing)
                if isinstance(answer, Failed):
                    raise InputError(answer.reason) if answer.by_input else RuntimeError(answer.reason)
                if isinstance(answer, Progress):
                    tell(worker.number, answer.missions)
                    continue
                tell(worker.number, missing[worker.number].missions)
                if waiting:
                    give(worker)
                else:
                    del at_work[channel]
    finally:
        for worker in team:
            worker.channel.close()
            worker.process.terminate()
        for worker in team:
            worker.process.join()


def _receive(worker: _Worker, missing: Sequence[Cell]) -> object:
    try:
        return worker.channel.recv()
    except (EOFError, ConnectionResetError):
        worker.process.join()
        cell, code = missing[worker.number], worker.process.exitcode or 0
        who = f"--workers: the process that computed {cell.row.name}, budget {cell.budget:g},"
        if code < 0:
            raise InputError(
                f"{who} was ended by signal {-code}, perhaps for want of memory; the same command goes on, give fewer "
                "workers"
            ) from None
        raise InputError(
            f"{who} ended by itself (exit code {code}), as its own words above say; a script that starts workers must "
            'do so under `if __name__ == "__main__":`'
        ) from None


def _kind(cell: Cell) -> Hashable:
    """Equal for cells that run the same compiled program."""
    return cell.row.name, cell.shape
