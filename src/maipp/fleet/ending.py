"""A process that ends when it is told to, whatever it is doing, and when one of its threads fails."""

import contextlib
import os
import signal
import socket
import sys
import threading
import time
import traceback
from types import FrameType, TracebackType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_GRACE = 1.5  # s, for an orderly end; everything that counts is on the disk before
_LAST = 0.3  # s, for the interpreter's own end, which waits for threads that others have left


class Ending:
    """In a `with` block, `requested` is set by Ctrl-C, by SIGTERM, and by an exception in any thread.

    A second and a half later the process is ended, should it still be there: compiled code minds no signal. So it is
    where the interpreter does not come to its end after the block.
    """

    def __init__(self) -> None:
        self.requested = threading.Event()
        self.code = 0
        self._over = threading.Event()

    @property
    def exit_code(self) -> int:
        """Of the process: 0 where it was told to end by a signal or by itself."""
        return self.code if self.code < 128 else 0

    def end(self, code: int = 0) -> None:
        """Tell the process to end with this exit code."""
        if not self.requested.is_set():
            self.code = code
            self.requested.set()
            threading.Thread(target=self._watch, daemon=True).start()

    def __enter__(self) -> "Ending":
        self._read, self._write = socket.socketpair()
        self._read.settimeout(None)
        self._write.setblocking(False)
        self._handlers = [signal.signal(number, self._on_signal) for number in _SIGNALS]
        self._wakeup = signal.set_wakeup_fd(self._write.fileno(), warn_on_full_buffer=False)
        self._hook, threading.excepthook = threading.excepthook, self._on_exception
        self._ear = threading.Thread(target=self._hear, name="signals", daemon=True)
        self._ear.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.end(1)
        self._over.set()
        signal.set_wakeup_fd(self._wakeup)
        for number, handler in zip(_SIGNALS, self._handlers, strict=True):
            signal.signal(number, handler)
        threading.excepthook = self._hook
        with contextlib.suppress(OSError):
            self._write.send(b"\0")
        self._ear.join(timeout=_LAST)
        self._read.close()
        self._write.close()

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.end(128 + number)

    def _hear(self) -> None:
        """Learn of signals while the main thread is in compiled code, which minds none."""
        while not self._over.is_set():
            told = self._read.recv(1)
            if told and told[0] in _SIGNALS:
                self.end(128 + told[0])

    def _on_exception(self, told: threading.ExceptHookArgs) -> None:
        if told.exc_type is not SystemExit:
            traceback.print_exception(told.exc_type, told.exc_value, told.exc_traceback)
            self.end(1)

    def _watch(self) -> None:
        if self._over.wait(_GRACE):
            threading.main_thread().join()
            time.sleep(_LAST)
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()
        os._exit(self.code)
