"""What is shown: handed from the thread that watches to the one that serves, as text that nobody changes any more."""

import json
import os
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

_WANTED = 20.0  # s that a belief is kept up to date after it was asked for
_MOST_ASKED = 100  # names that are remembered


class Cursor(NamedTuple):
    """How much of a board somebody has seen."""

    instance: str = ""
    version: int = 0
    rows: int = 0

    def __str__(self) -> str:
        return f"{self.instance}.{self.version}.{self.rows}"

    @classmethod
    def read(cls, text: str) -> "Cursor":
        """The cursor that `str` made a text of; that of a newcomer for any other."""
        instance, _, rest = text.partition(".")
        version, _, rows = rest.partition(".")
        if not (instance and version.isdecimal() and rows.isdecimal() and len(text) < 80):
            return cls()
        return cls(instance, int(version), int(rows))


class Shown(NamedTuple):
    """The maps of a belief: what they are made of, None if there is no such robot, and JSON."""

    mark: str | None
    text: str


class Board:
    """The latest snapshot in parts, and the beliefs that were asked for. Safe for use by several threads."""

    def __init__(self) -> None:
        self.instance = os.urandom(6).hex()  # tells a page that another server is there
        self.closed = False
        self._lock = threading.Lock()
        self._version = 0
        self._parts: dict[str, tuple[int, str]] = {}  # version in which it changed last, and JSON
        self._rows: list[str] = []  # JSON of each
        self._fields: dict[str, Shown] = {}  # by robot; "" for all together
        self._asked: dict[str, float] = {}
        self._listeners: list[Callable[[], object]] = []

    # For the one who watches.

    def publish(self, snapshot: dict[str, Any]) -> bool:
        """Show a snapshot of `Watch`; whether anything in it is new."""
        rows = snapshot["rows"]
        parts = {name: to_json(part) for name, part in snapshot.items() if name != "rows"}
        with self._lock:
            new = [name for name, text in parts.items() if self._parts.get(name, (0, ""))[1] != text]
            added = [to_json(row) for row in rows[len(self._rows) :]]
            if not new and not added:
                return False
            self._version += 1
            self._parts.update({name: (self._version, parts[name]) for name in new})
            self._rows += added
        self._wake()
        return True

    def publish_field(self, robot: str | None, field: dict[str, Any]) -> None:
        """Show the maps of a belief."""
        with self._lock:
            self._fields[robot or ""] = Shown(field["mark"], to_json(field))
        self._wake()

    def wanted(self) -> list[str | None]:
        """Whose beliefs somebody is looking at."""
        now = time.monotonic()
        with self._lock:
            self._asked = {name: when for name, when in self._asked.items() if now - when < _WANTED}
            for name in [name for name in self._fields if name not in self._asked]:
                del self._fields[name]
            return [name or None for name in self._asked]

    def close(self) -> None:
        """Let all that are listening go."""
        self.closed = True
        self._wake()

    # For those who serve.

    def news(self, seen: Cursor) -> tuple[str, Cursor] | None:
        """JSON of what somebody has not seen, and how far that goes; None where there is nothing."""
        with self._lock:
            if not self._version:
                return None
            if seen.instance != self.instance or seen.version > self._version or seen.rows > len(self._rows):
                seen = Cursor(self.instance)
            now = Cursor(self.instance, self._version, len(self._rows))
            if seen == now:
                return None
            parts = {name: text for name, (version, text) in self._parts.items() if version > seen.version}
            rows = self._rows[seen.rows :]
        told = ",".join(f"{to_json(name)}:{text}" for name, text in parts.items())
        head = f'"instance":{to_json(self.instance)},"from":{seen.rows}'
        return f'{{{head},"rows":[{",".join(rows)}],"parts":{{{told}}}}}', now

    def ask(self, robot: str) -> Shown | None:
        """The maps of a belief ("": of all together), kept up to date from now on; None: not worked out yet."""
        with self._lock:
            if robot in self._asked or len(self._asked) < _MOST_ASKED:
                self._asked[robot] = time.monotonic()
            return self._fields.get(robot)

    def listen(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call the listener, from any thread, after each change. Returns what ends that."""
        with self._lock:
            self._listeners.append(listener)

        def end() -> None:
            with self._lock:
                self._listeners.remove(listener)

        return end

    def _wake(self) -> None:
        with self._lock:
            listeners = [*self._listeners]
        for listener in listeners:
            listener()


def to_json(value: Any) -> str:
    """Short, of ASCII, and strict."""
    return json.dumps(value, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
