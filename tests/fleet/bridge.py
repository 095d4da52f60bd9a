"""The other side of a lines vehicle, in memory."""

import json
from typing import Any

from maipp.fleet.clock import VirtualClock
from maipp.fleet.line_streams import LineInput, LineOutput
from maipp.fleet.lines import Lines
from maipp.fleet.vehicle import Fix
from maipp.live.units import Units

UNITS = Units((1.0, 1.0))


class Source(LineInput):
    """Lines that have come in."""

    def __init__(self):
        self.waiting, self.ended, self.number = [], False, 0

    def take(self, most):
        taken, self.waiting = self.waiting[:most], self.waiting[most:]
        return taken

    def wait(self, seconds):
        pass


class Sink(LineOutput):
    """Lines that go out."""

    problem = None

    def __init__(self):
        self.lines: list[Any] = []
        self.closed = 0

    def put(self, line, *, always=True):
        self.lines.append(json.loads(line))
        return True

    def close(self):
        self.closed += 1


class Bridge:
    """The other side of a lines vehicle."""

    def __init__(self, gated=False):
        self.clock, self.source, self.sink, self.told = VirtualClock(7.0), Source(), Sink(), []
        presumed = Fix(7.0, (0.5, 0.5))
        streams: Any = self.source, self.sink
        self.vehicle = Lines("boat1", UNITS, self.clock, lambda: presumed, self.told.append, *streams, gated=gated)
        self.heard()

    def send(self, line: Any):
        """A line from the bridge: bytes, or an object."""
        self.source.number += 1
        text = line if isinstance(line, bytes) else json.dumps(line).encode()
        self.source.waiting.append((self.source.number, text))

    def heard(self) -> list[Any]:
        """What the bridge was told since the last call."""
        lines, self.sink.lines = self.sink.lines, []
        return lines
