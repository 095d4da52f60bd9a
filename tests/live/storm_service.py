"""A `maipp live` process that can be killed, and asked line by line."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).parents[2] / "src"


@dataclass
class Service:
    """A `maipp live` process on a journal, started when it is first needed."""

    scenario: Path
    journal: Path
    planner: str
    adapt: bool = False
    process: "subprocess.Popen[bytes] | None" = None
    ready: dict[str, Any] = field(default_factory=dict)
    starts: int = 0

    def begin(self, wait: bool = True) -> None:
        """Start it; with `wait` until it says that it is ready."""
        command = [sys.executable, "-m", "maipp", "live", str(self.scenario), "--journal", str(self.journal)]
        path = os.pathsep.join(filter(None, [str(SOURCE), os.environ.get("PYTHONPATH")]))
        self.process = subprocess.Popen(
            [*command, "--planner", self.planner, *(["--adapt"] if self.adapt else [])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": path},
        )
        self.starts += 1
        if wait:
            self.ready = json.loads(self.receive())
            assert self.ready["answer"] == "ready", self.ready

    def cpu_seconds(self) -> float:
        """Processor time it has used, all threads together (Linux)."""
        assert self.process is not None
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def send(self, line: bytes) -> None:
        """One line, which need not be read yet."""
        assert self.process is not None and self.process.stdin is not None
        self.process.stdin.write(line)
        self.process.stdin.flush()

    def receive(self) -> bytes:
        """The next answer."""
        assert self.process is not None and self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line.endswith(b"\n"), f"the process ended: {line!r}"
        return line

    def ask(self, line: bytes) -> bytes:
        """The answer to a line."""
        self.send(line)
        return self.receive()

    def kill(self) -> list[bytes]:
        """Kill it without warning; the whole answers that it had still sent."""
        assert self.process is not None and self.process.stdout is not None
        self.process.kill()
        left = self.process.stdout.read()
        self._reap()
        return [line for line in left.splitlines(keepends=True) if line.endswith(b"\n")]

    def stop(self) -> int:
        """End its input and wait for it; gives its exit code."""
        assert self.process is not None and self.process.stdin is not None
        self.process.stdin.close()
        return self._reap()

    def _reap(self) -> int:
        assert self.process is not None
        for stream in (self.process.stdin, self.process.stdout):
            try:
                if stream is not None:
                    stream.close()
            except BrokenPipeError:
                pass
        code = self.process.wait()
        self.process = None
        return code


def encode(event: dict[str, Any]) -> bytes:
    """An event as a line."""
    return json.dumps(event).encode() + b"\n"
