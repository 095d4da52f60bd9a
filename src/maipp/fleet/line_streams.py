"""Lines over a process's own streams, by threads of their own: whoever polls never waits for the other side."""

import contextlib
import os
import queue
import threading
from collections import deque
from collections.abc import Callable
from functools import partial

from maipp.live.serve import lines

_QUEUE = 1000  # lines that are read ahead; the other side then waits
_CHUNK = 1 << 16
_LAST_WORDS = 0.5  # s that the other side has to read what is left at the end


class LineInput:
    """Lines that come in, each with its number; too long ones are cut so that whoever parses them tells."""

    def __init__(self, read: Callable[[int], bytes] | None = None) -> None:
        """`read` waits for some bytes, at most so many; none are the end; left out: standard input."""
        self._read, self._rest = read or partial(os.read, 0), bytearray()
        self._queue: queue.Queue[tuple[int, bytes] | None] = queue.Queue(_QUEUE)
        self.ended = False  # nothing more comes
        # A daemon: nothing can be done about a read that waits, and it holds no lock.
        threading.Thread(target=self._run, name="lines in", daemon=True).start()

    def take(self, most: int) -> list[tuple[int, bytes]]:
        """What has come since the last call, at most so many."""
        taken: list[tuple[int, bytes]] = []
        with contextlib.suppress(queue.Empty):
            while len(taken) < most and not self.ended:
                entry = self._queue.get_nowait()
                if entry is None:
                    self.ended = True
                else:
                    taken.append(entry)
        return taken

    def wait(self, seconds: float) -> None:
        """Until something has come, or that long."""
        end = threading.Event()
        while self._queue.empty() and seconds > 0 and not self.ended:
            end.wait(min(seconds, 0.02))
            seconds -= 0.02

    def _run(self) -> None:
        with contextlib.suppress(OSError):
            for entry in enumerate(lines(self._line), start=1):
                self._queue.put(entry)
        self._queue.put(None)

    def _line(self, most: int) -> bytes:
        """The next line with its end, or its first `most` bytes."""
        seen = 0
        while (end := self._rest.find(b"\n", seen, most)) < 0 and len(self._rest) < most:
            seen = len(self._rest)
            if not (chunk := self._read(_CHUNK)):
                break
            self._rest += chunk
        cut = end + 1 if end >= 0 else most
        line = bytes(self._rest[:cut])
        del self._rest[:cut]
        return line


class LineOutput:
    """Lines that go out, in order. What the other side does not read is kept, up to a limit."""

    def __init__(self, write: Callable[[bytes], int] | None = None) -> None:
        """`write` writes some of the bytes, and says how many; left out: to standard output."""
        self._write = write or partial(os.write, 1)
        self._lines: deque[bytes] = deque()
        self._news = threading.Condition()
        self._closed = False
        self.problem: str | None = None  # why nothing goes out any more
        self._thread = threading.Thread(target=self._run, name="lines out", daemon=True)
        self._thread.start()

    def put(self, line: bytes, *, always: bool = True) -> bool:
        """Send a line; one that may be left out is, once too many wait: then False."""
        with self._news:
            if len(self._lines) >= _QUEUE and not always:
                return False
            self._lines.append(line)
            self._news.notify()
        return True

    def close(self) -> None:
        """Let the other side read what is left, for a moment."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join(_LAST_WORDS)

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._lines or self._closed)
                if not self._lines:
                    return
                rest = self._lines.popleft()
            try:
                while rest:
                    rest = rest[self._write(rest) :]
            except OSError as error:
                self.problem = error.strerror or str(error)
                return
