"""A whole fleet on one computer: every robot a process of its own, talking over loopback."""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from maipp.errors import InputError

_END = 3.0  # s that robots have to end before they are killed


@dataclass
class Process:
    """One robot's process. Its notes go to a file, and line by line to whoever listens."""

    name: str
    command: Sequence[str]
    notes: Path
    heard: Callable[[str, str], None]  # name, line
    ready: threading.Event = field(default_factory=threading.Event)

    def start(self) -> None:
        """Start it, or start it again."""
        self.ready.clear()
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [*self.command],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=environment,
            start_new_session=True,  # Ctrl-C is for the one who started them, who ends them
        )
        self._reader = threading.Thread(target=self._read, daemon=True, name=f"notes of {self.name}")
        self._reader.start()

    def begin(self, at: float) -> None:
        """Let a robot that waits for it begin, at this Unix time."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.write(f"{at!r}\n".encode("ascii"))
            self.process.stdin.flush()

    @property
    def running(self) -> bool:
        """Whether it is."""
        return self.process.poll() is None

    def kill(self) -> None:
        """End it at once, as a power cut does."""
        self.process.kill()
        self.process.wait()

    def end(self) -> None:
        """Tell it to end; does not wait."""
        with contextlib.suppress(OSError):
            self.process.terminate()

    def wait(self, until: float) -> None:
        """Wait for its end, until a monotonic time; then kill it."""
        try:
            self.process.wait(max(until - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self.kill()
        self._reader.join(timeout=1.0)
        for stream in (self.process.stdin, self.process.stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def _read(self) -> None:
        assert self.process.stderr is not None
        with open(self.notes, "ab") as file, contextlib.suppress(ValueError):
            for line in self.process.stderr:
                file.write(line)
                file.flush()
                text = line.decode("utf-8", "replace").rstrip()
                if text.endswith(" ready"):
                    self.ready.set()
                self.heard(self.name, text)


def free_ports(count: int) -> list[int]:
    """Ports of this computer that nobody listens at now."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def endpoints(names: Sequence[str]) -> dict[str, tuple[str, list[str]]]:
    """For each robot the address at which it listens, and those of the ones before it, which it connects to."""
    addresses = [f"tcp/127.0.0.1:{port}" for port in free_ports(len(names))]
    return {name: (addresses[i], addresses[:i]) for i, name in enumerate(names)}


def robot_command(mission: Path, name: str, folder: Path, more: Sequence[str]) -> list[str]:
    """The command that runs one robot."""
    return [sys.executable, "-m", "maipp", "robot", str(mission), "--name", name, "--log", str(folder), *more]


class FleetProcesses:
    """The processes of a simulated fleet. Use it in a `with` block: at its end all of them have ended."""

    def __init__(self, processes: Sequence[Process]) -> None:
        self.processes = {process.name: process for process in processes}

    def __enter__(self) -> "FleetProcesses":
        try:
            for process in self.processes.values():
                process.start()
        except OSError as error:
            self.__exit__()
            raise InputError(f"a robot's process cannot be started: {error.strerror or error}") from None
        return self

    def __exit__(self, *_: object) -> None:
        started = [process for process in self.processes.values() if hasattr(process, "process")]
        for process in started:
            process.end()
        until = time.monotonic() + _END
        for process in started:
            process.wait(until)

    def ended(self) -> list[Process]:
        """Those that are not running."""
        return [process for process in self.processes.values() if not process.running]
