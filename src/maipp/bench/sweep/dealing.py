"""One executor for every sweep: jobs dealt to the processes of this machine or to the workers of a cluster.

Workers give results back, and whoever sweeps keeps them: what dies loses the jobs that were under way, and no other.
"""

import bisect
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from maipp.bench.sweep.cluster import Cluster
from maipp.bench.sweep.jobs import LOST, Job
from maipp.bench.sweep.local import Processes, default_workers

Number = int  # of a job among those of the sweep


@runtime_checkable
class Crew(Protocol):
    """Those who work on a sweep: seats, each of which works on one job at a time."""

    def free(self) -> Collection[Hashable]:
        """The seats that have nothing to do. Seats come and go."""
        ...

    def give(self, seat: Hashable, number: Number, job: Job) -> None:
        """Have a free seat do a job."""
        ...

    def wait(self) -> Iterable[tuple[Number, Any]]:
        """Wait for a while; gives what jobs came to since: a result, an error, or `LOST` for one to be done again."""
        ...

    def close(self) -> None:
        """Give up what is under way."""
        ...


@dataclass(frozen=True)
class Where:
    """Where a sweep runs."""

    workers: int | None = None  # processes of this machine; 0: this one, on all devices; None: `default_workers`
    cluster: str | None = None  # address of a scheduler, which then replaces them
    tls: Path | None = None  # folder of its certificates
    patience: float = 60.0  # seconds without a worker, or a word of the scheduler, after which the sweep ends


HERE = Where(workers=0)


def run_sweep(
    jobs: Sequence[Job],
    keep: Callable[[Number, Any], None],
    *,
    where: Where = HERE,
    begun: Callable[[Number], None] = lambda number: None,
    note: Callable[[str], None] = lambda line: None,
) -> None:
    """Do the jobs; `keep` is given each result as it comes, `begun` the number of a job that somebody starts on.

    Results do not depend on where that is, but for rounding where `workers` is 0. However this ends, no process of
    this machine is left. Raises `InputError` where a job does, where one has killed its worker again and again, and
    where there is no cluster to work with; `note` hears of workers that are no use.
    """
    if not jobs:
        return
    if where.cluster is not None:
        crew: Crew = Cluster(where.cluster, where.tls, where.patience, note)
    else:
        workers = default_workers() if where.workers is None else where.workers
        if not workers:
            for number, job in enumerate(jobs):
                begun(number)
                keep(number, job.compute())
            return
        crew = Processes(min(workers, len(jobs)))
    with closing(crew):
        _deal(jobs, crew, keep, begun)


def _deal(
    jobs: Sequence[Job], crew: Crew, keep: Callable[[Number, Any], None], begun: Callable[[Number], None]
) -> None:
    """Give every seat that is free a job until all are done."""
    kinds = [job.kind for job in jobs]
    waiting = list(range(len(jobs)))
    at: dict[Number, Hashable] = {}  # the seat that a job was given to
    last: dict[Hashable, Hashable] = {}  # what a seat has compiled
    while waiting or at:
        for seat in crew.free():
            if waiting:
                busy = {kinds[number] for number, other in at.items() if other != seat}
                number = choose(waiting, kinds, last.get(seat), busy)
                waiting.remove(number)
                at[number], last[seat] = seat, kinds[number]
                begun(number)
                crew.give(seat, number, jobs[number])
        for number, result in crew.wait():
            del at[number]
            if result is LOST:
                bisect.insort(waiting, number)
            elif isinstance(result, Exception):
                raise result
            else:
                keep(number, result)


def choose(waiting: Sequence[int], kinds: Sequence[Hashable], last: Hashable, busy: Collection[Hashable]) -> int:
    """The number of the job that a seat takes next: one of `waiting`, numbers of jobs in order.

    `kinds[number]` is equal for jobs that share a compilation, `last` what the seat has compiled and `busy` what
    the others have. It goes on with its kind; else it begins the first that nobody has; else it helps with what most is
    left of. Of a kind the last job, which takes longest, comes first and helpers take the shortest, so that at the end
    nobody waits for long.
    """
    left = Counter(kinds[number] for number in waiting)
    own = [last] if last in left else [kind for kind in left if kind not in busy]
    if own:
        return max(number for number in waiting if kinds[number] == own[0])
    (most, _), *_ = left.most_common(1)
    return min(number for number in waiting if kinds[number] == most)
