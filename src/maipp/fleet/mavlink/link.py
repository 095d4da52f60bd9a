"""A connection that speaks MAVLink 2: a thread that reads, stamps each message with its time, and sends heartbeats."""

import contextlib
import queue
import select
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from maipp.errors import InputError

_QUEUE = 5000  # messages that are kept while nobody polls: some 50 a second come
_ONBOARD, _NO_AUTOPILOT, _ACTIVE = 18, 8, 4  # MAV_TYPE_ONBOARD_CONTROLLER, MAV_AUTOPILOT_INVALID, MAV_STATE_ACTIVE
COMPONENT = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
_HEARTBEAT, _AGAIN = 1.0, 0.5  # s
# A cable that was pulled out, or the other side closed the connection, after which pymavlink has no port.
_FAILS = (OSError, ValueError, AttributeError, TypeError)


class StampedMessage(NamedTuple):
    """A message, and when it came."""

    message: Any
    time: float  # the survey's
    now: float  # monotonic seconds


class MavlinkConnection:
    """The way to an autopilot. `send` and `take` are for one thread."""

    def __init__(self, url: str, baud: int, system: int, clock: Callable[[], float]) -> None:
        """Raises `InputError` for an address that cannot be opened, and where the extra is missing."""
        try:
            from pymavlink import mavutil
            from pymavlink.dialects.v20 import ardupilotmega as dialect
        except ImportError:
            raise InputError("--vehicle mavlink needs pymavlink: pip install 'maipp[mavlink]'") from None
        self._open = partial(mavutil.mavlink_connection, url, baud=baud, autoreconnect=True, retries=0)
        try:
            self._port = self._open()
        except Exception as error:  # of sockets, serial ports, and pymavlink's own
            raise InputError(f"--with url={url}: cannot be opened: {' '.join(str(error).split())}") from None
        self._mav = dialect.MAVLink(self._port, srcSystem=system, srcComponent=COMPONENT)
        self._mav.robust_parsing = True
        self._clock, self._lock, self._ended = clock, threading.Lock(), threading.Event()
        self._queue: queue.Queue[StampedMessage] = queue.Queue(_QUEUE)
        self._thread = threading.Thread(target=self._run, name="mavlink", daemon=True)
        self._thread.start()

    def send(self, name: str, *fields: Any) -> None:
        """Send a message; one that does not get out is as one that is lost."""
        with self._lock, contextlib.suppress(*_FAILS):
            getattr(self._mav, f"{name}_send")(*fields)

    def take(self) -> list[StampedMessage]:
        """What has come since the last call."""
        taken = []
        while len(taken) < _QUEUE:
            try:
                taken.append(self._queue.get_nowait())
            except queue.Empty:
                break
        return taken

    def close(self) -> None:
        """End the thread, and let go of the address."""
        self._ended.set()
        self._thread.join(1.0)
        with contextlib.suppress(*_FAILS):
            self._port.close()

    def _run(self) -> None:
        beat = -_HEARTBEAT
        while not self._ended.is_set():
            now = time.monotonic()
            if now - beat >= _HEARTBEAT:
                beat = now
                self.send("heartbeat", _ONBOARD, _NO_AUTOPILOT, 0, 0, _ACTIVE)
            try:
                self._wait()
                text = self._port.recv()
            except _FAILS:
                self._ended.wait(_AGAIN)
                self._reopen()
                continue
            for message in self._parsed(text):
                self._put(StampedMessage(message, self._clock(), time.monotonic()))

    def _parsed(self, text: bytes | str) -> list[Any]:
        """The messages of what was received (a text is nothing); noise may look like one that cannot be decoded."""
        try:
            return self._mav.parse_buffer(text) or [] if isinstance(text, bytes) else []
        except Exception:
            return []

    def _reopen(self) -> None:
        with self._lock, contextlib.suppress(*_FAILS):
            with contextlib.suppress(*_FAILS):
                self._port.close()
            self._port = self._open()
            self._mav.file = self._port

    def _wait(self) -> None:
        """Until something has come, or a moment."""
        fd = self._port.fd
        if fd is None or fd < 0:
            self._ended.wait(0.05)
        else:
            select.select([fd], [], [], 0.05)

    def _put(self, heard: StampedMessage) -> None:
        while True:
            try:
                return self._queue.put_nowait(heard)
            except queue.Full:  # the oldest tells least
                try:
                    self._queue.get_nowait()
                except queue.Empty:
                    continue
