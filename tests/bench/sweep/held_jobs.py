"""Jobs that tell who does them, and wait or die as they are told; workers import them from here."""

import os
import signal
import sys
import time
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maipp.bench.sweep.dealing import Where, run_sweep

STARTED, HOLD = "started", "hold"


@dataclass(frozen=True)
class Held:
    """The square of a number; of one below 4 once the folder has no file `hold` any more."""

    number: int
    folder: str
    deaths: int = 0  # how many of those who do it are killed
    fails: bool = False
    ends: bool = False
    moody: bool = False

    @property
    def key(self) -> str:
        """Its name."""
        return f"held-{self.number}"

    @property
    def kind(self) -> Hashable:
        """All are of one kind."""
        return "held"

    @property
    def words(self) -> str:
        """What it is."""
        return f"job {self.number}"

    @property
    def made_by(self) -> Mapping[str, Any]:
        """What decides the square, and more where it is moody."""
        return {"number": self.number, "process": os.getpid() if self.moody else 0}

    def compute(self) -> int:
        """The square."""
        with open(Path(self.folder) / STARTED, "a", encoding="utf-8") as file:
            file.write(f"{self.key} {os.getpid()} {os.getppid()}\n")
        if self.ends:
            os._exit(3)
        if sum(key == self.key for key, _ in started(self.folder)) <= self.deaths:
            os.kill(os.getpid(), signal.SIGKILL)
        while self.number < 4 and (Path(self.folder) / HOLD).exists():
            time.sleep(0.02)
        return 1 // 0 if self.fails else self.number**2


def held(count: int, folder: str | Path, dies: Mapping[int, int] | None = None) -> list[Held]:
    """So many jobs; `dies` has how often those who do one are killed."""
    return [Held(number, str(folder), (dies or {}).get(number, 0)) for number in range(count)]


def started(folder: str | Path) -> list[tuple[str, int]]:
    """Job and process of every start so far, in their order."""
    path = Path(folder) / STARTED
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [(key, int(process)) for key, process, _ in map(str.split, lines)]


def main() -> None:
    """Have a cluster do what a folder has not kept; words: its address, folder, how many, and certificates if any."""
    address, folder, count, *tls = sys.argv[1:]
    jobs = [job for job in held(int(count), folder) if not (Path(folder) / job.key).exists()]

    def keep(number: int, result: int) -> None:
        (Path(folder) / jobs[number].key).write_text(str(result), encoding="utf-8")

    where = Where(cluster=address, tls=Path(tls[0]) if tls else None, patience=30.0)
    run_sweep(jobs, keep, where=where, note=lambda line: print(line, file=sys.stderr))
