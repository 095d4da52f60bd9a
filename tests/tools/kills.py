"""`python -m tests.tools.kills --out DIR`: Table I on a cluster whose worker, nanny and client are killed on the way.

At a fifth of the cells a worker's process is killed, at two fifths a whole `maipp worker`, which is started again,
and at three fifths the client, which is started again. At the end every cell has to be there, each computed once but
those that were under way, and like those in DIR of --reference to the last digit.
"""

import importlib
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from maipp.bench.cells import CELLS, Cell, cells
from maipp.bench.sweep.dealing import Where, run_sweep
from maipp.bench.tables import TABLES

STARTS = "starts"  # file of all starts: the cell and the processes


@dataclass(frozen=True)
class Counted:
    """A cell that writes down when it is begun."""

    cell: Cell
    folder: str

    @property
    def key(self) -> str:
        """The cell's."""
        return self.cell.key

    @property
    def kind(self) -> Hashable:
        """The cell's."""
        return self.cell.kind

    @property
    def words(self) -> str:
        """The cell's."""
        return self.cell.words

    @property
    def made_by(self) -> Mapping[str, Any]:
        """The cell's."""
        return self.cell.made_by

    def compute(self) -> Any:
        """The cell's result."""
        with open(Path(self.folder) / STARTS, "a", encoding="utf-8") as file:
            file.write(f"{self.cell.file} {os.getpid()} {os.getppid()}\n")
        return self.cell.compute()


@dataclass(frozen=True)
class Kills:
    """Fill Table I --quick on a cluster that things happen to."""

    out: Path
    """folder for the cells"""

    reference: Path | None = None
    """folder of the same table, filled otherwise"""

    planners: tuple[str, ...] = ()
    """rows; left out: those of --quick"""

    port: int = 8797
    """of the scheduler"""

    client: bool = False
    """be the client (the tool starts it so)"""


def wanted(flags: Kills) -> list[Cell]:
    """The cells of the table."""
    rows = [row for row in TABLES["table1"].chosen(flags.planners) if row.quick]
    return list(cells(TABLES["table1"], rows, TABLES["table1"].quick_sample))


def sweep(flags: Kills) -> None:
    """Be the client."""
    missing = [Counted(cell, str(flags.out.resolve())) for cell in wanted(flags) if cell.load(flags.out) is None]
    where = Where(cluster=f"tcp://127.0.0.1:{flags.port}")
    run_sweep(missing, lambda number, result: missing[number].cell.save(result, flags.out), where=where, note=print)


def starts(folder: Path) -> list[list[str]]:
    """Cell, process and its parent of every start so far."""
    path = folder / STARTS
    return [line.split() for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def at_work(folder: Path) -> list[tuple[str, int, int]]:
    """The last start of each cell that is not kept: the cell, who computes it and the nanny."""
    last = {cell: (cell, int(process), int(parent)) for cell, process, parent in starts(folder)}
    return [one for cell, one in last.items() if cell not in done(folder)]


def done(folder: Path) -> set[str]:
    """The cells that are kept."""
    return {path.name for path in (folder / CELLS).glob("*.json")}


def run(flags: Kills) -> int:
    """Do it all; gives 0 where nothing was lost."""
    flags.out.mkdir(parents=True)
    count = len(wanted(flags))
    address = f"tcp://127.0.0.1:{flags.port}"
    cores = sorted(os.sched_getaffinity(0))

    def maipp(*words: str, core: int | None = None) -> subprocess.Popen:
        pinned = [] if core is None else ["taskset", "-c", str(core)]
        return subprocess.Popen([*pinned, sys.executable, "-m", "maipp", *words])

    client_words = [sys.executable, "-m", "tests.tools.kills", "--client", *sys.argv[1:]]
    scheduler = maipp("scheduler", address)
    workers = [maipp("worker", address, core=core) for core in cores[:2]]
    client = subprocess.Popen(client_words)
    begun, under_way = time.monotonic(), set()
    try:
        for share, victim in ((1, "worker"), (2, "nanny"), (3, "client")):
            while len(done(flags.out)) < count * share // 5 or not at_work(flags.out):
                if client.poll() is not None:
                    raise SystemExit(f"the client ended with {client.returncode}")
                time.sleep(0.2)
            at = at_work(flags.out)
            under_way |= {cell for cell, *_ in at}
            print(
                f"{time.monotonic() - begun:.0f} s: kill the {victim}; under way: {[one[0] for one in at]}", flush=True
            )
            if victim == "worker":
                os.kill(at[-1][1], signal.SIGKILL)
            elif victim == "nanny":
                nanny = next(worker for worker in workers if worker.pid == at[-1][2])
                nanny.kill()
                nanny.wait()
                workers[workers.index(nanny)] = maipp("worker", address, core=cores[workers.index(nanny)])
            else:
                client.kill()
                client.wait()
                time.sleep(2)  # until workers have begun on what they were given last
                under_way |= {cell for cell, *_ in at_work(flags.out)}
                client = subprocess.Popen(client_words)
        code = client.wait()
    finally:
        for process in (client, *workers, scheduler):
            process.terminate()
            process.wait()
    times = Counter(cell for cell, *_ in starts(flags.out))
    again = {cell for cell, number in times.items() if number > 1}
    print(
        f"the client's exit code: {code}; {len(done(flags.out))} of {count} cells; {sum(times.values())} starts in "
        f"{time.monotonic() - begun:.0f} s; begun again: {sorted(again)}, of them not under way at a kill: "
        f"{sorted(again - under_way)}"
    )
    good = code == 0 and len(done(flags.out)) == count and again <= under_way
    if flags.reference is not None:
        theirs = {named(path): values(path) for path in (flags.reference / CELLS).glob("*.json")}
        alike = [values(flags.out / CELLS / name) == theirs.get(named(Path(name))) for name in done(flags.out)]
        print(f"{sum(alike)} of {len(alike)} cells are those of {flags.reference} to the last digit")
        good = good and all(alike)
    return 0 if good else 1


def named(path: Path) -> str:
    """Row and budget of a cell's file."""
    return path.name.rsplit(".", 2)[0]


def values(path: Path) -> Any:
    """The numbers of a cell's file."""
    return json.loads(path.read_text(encoding="utf-8"))["values"]


def main() -> int:
    """Be the tool, or the client that it starts."""
    flags = tyro.cli(Kills, prog="python -m tests.tools.kills")
    if not flags.client:
        return run(flags)
    sys.argv = [sys.argv[0], *(word for word in sys.argv[1:] if word != "--client")]
    sweep(flags)
    return 0


if __name__ == "__main__":
    # Under its own name: workers have to find what is pickled.
    sys.exit(importlib.import_module("tests.tools.kills").main())
