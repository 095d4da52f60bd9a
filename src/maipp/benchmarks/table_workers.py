"""Filling a table by several processes, one per core."""

import multiprocessing
import os
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

import jax

from maipp.benchmarks.cells import Cell
from maipp.benchmarks.table_worker import work
from maipp.cgroup import memory_limit
from maipp.devices import core_count, cores_here
from maipp.errors import InputError

_MEMORY_OF_ONE = 2 << 30  # bytes that a worker may come to need: 1.4 GB was seen, most of it to compile

# Number of the cell among those to compute, and its missions done: 0 when it begins, all at last.
Tell = Callable[[int, int], None]


def default_workers() -> int:
    """One per core, fewer where memory would not do; none where JAX has an accelerator."""
    if jax.default_backend() != "cpu":
        return 0
    limit = memory_limit()
    memory = [] if limit is None else [limit]
    with suppress(AttributeError, ValueError, OSError):  # where the system does not tell
        memory.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return max(1, min([core_count(), *(size // _MEMORY_OF_ONE for size in memory)]))


def choose(waiting: Sequence[int], kinds: Sequence[Hashable], last: Hashable, busy: Collection[Hashable]) -> int:
    """The number of the cell that a worker takes next: one of `waiting`, numbers of cells in order.

    `kinds[number]` is equal for cells that share a compilation, `last` what the worker has compiled and `busy` what
    the others have. It goes on with its kind; else it begins the first that nobody has; else it helps with what most is
    left of. Of a kind the last cell, which takes longest, comes first and helpers take the shortest, so that at the end
    nobody waits for long.
    """
    left = Counter(kinds[number] for number in waiting)
    own = [last] if last in left else [kind for kind in left if kind not in busy]
    if own:
        return max(number for number in waiting if kinds[number] == own[0])
    (most, _), *_ = left.most_common(1)
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
    team: dict[Connection, SpawnProcess] = {}
    at: dict[Connection, int] = {}  # the number of the cell that a worker is at

    def give(channel: Connection) -> None:
        last = kinds[at[channel]] if channel in at else None
        others = {kinds[number] for other, number in at.items() if other is not channel}
        number = at[channel] = choose(waiting, kinds, last, others)
        waiting.remove(number)
        tell(number, 0)
        with suppress(BrokenPipeError):  # it has ended, as waiting for its answer will tell
            channel.send(missing[number])

    try:
        for i in range(min(workers, len(missing))):
            ours, theirs = context.Pipe()
            core = cores[i % len(cores)]
            process = context.Process(target=work, args=(theirs, folder, core), daemon=True, name=f"maipp worker {i}")
            process.start()
            theirs.close()  # so that the channel ends when the worker does
            team[ours] = process
            give(ours)
        while at:
            for channel in wait(at):
                assert isinstance(channel, Connection)
                number = at[channel]
                try:
                    answer = channel.recv()
                except (EOFError, ConnectionResetError):
                    raise _ended(team[channel], missing[number]) from None
                if isinstance(answer, Exception):
                    raise answer
                tell(number, missing[number].missions if answer is None else answer)
                if answer is None and waiting:
                    give(channel)
                elif answer is None:
                    del at[channel]
    finally:
        for channel, process in team.items():
            channel.close()
            process.terminate()
        for process in team.values():
            process.join()


def _ended(process: SpawnProcess, cell: Cell) -> InputError:
    """What to say of a worker that is no more."""
    process.join()
    code = process.exitcode or 0
    who = f"--workers: the process that computed {cell.row.name}, budget {cell.budget:g},"
    if code < 0:
        return InputError(
            f"{who} was ended by signal {-code}, perhaps for want of memory; the same command goes on, give fewer "
            "workers"
        )
    return InputError(
        f"{who} ended by itself (exit code {code}), as its own words above say; a script that starts workers must "
        'do so under `if __name__ == "__main__":`'
    )


def _kind(cell: Cell) -> Hashable:
    """Equal for cells that run the same compiled program."""
    return cell.row.name, cell.shape
