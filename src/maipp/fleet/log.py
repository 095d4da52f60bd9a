"""The log of one robot: a file of chained lines that only this robot adds to, and that anybody may carry.

Each start of the robot begins a log of its own, named by a random incarnation, so that nothing that was lost with a
disk can be written a second time. An event is known by robot, incarnation and its line's number, never by a clock.
Two copies of a log are equal, one is the beginning of the other, or somebody has written two (a fork).
"""

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from maipp.errors import InputError
from maipp.live.chain import follow, link

# A signature is kept of every so many lines, so that parts of a log can be proved; and of the last. So many lines are
# some 5 kB packed, which a slow radio still brings within a second.
SIGNED_EVERY = 64
# Longest line, bytes; most lines of a log.
LONGEST_LINE, MOST_LINES = 1 << 20, 1_000_000

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")
_INCARNATION = re.compile(r"[0-9a-f]{8}")


class ForkError(ValueError):
    """Lines that do not follow what is known of the log: it was written twice, or somebody has changed it."""


class Origin(NamedTuple):
    """Whose log: a robot, and which of its starts."""

    robot: str
    incarnation: str  # eight hexadecimal digits

    def __str__(self) -> str:
        return f"{self.robot}.{self.incarnation}"


class Head(NamedTuple):
    """How far a log goes: its number of lines, the last one's checksum, and its robot's signature of both."""

    length: int
    chain: bytes
    signature: bytes = b""


def check_name(name: str, where: str) -> str:
    """The name of a robot or of a watcher. Raises `InputError` for one that could mean another, or several."""
    if not is_name(name):
        raise InputError(
            f"{where}: {name!r:.60} is no name of a robot in a fleet; give 1 to 40 letters, digits, '-', '_' and '.', "
            "with a letter or digit first"
        )
    return name


def is_name(name: str) -> bool:
    """Whether a robot or a watcher of a fleet may be called so."""
    return _NAME.fullmatch(name) is not None


def read_origin(text: str) -> Origin:
    """The origin that `str` made a text of. Raises `ValueError` for another text."""
    robot, _, incarnation = text.rpartition(".")
    if not (_NAME.fullmatch(robot) and _INCARNATION.fullmatch(incarnation)):
        raise ValueError(f"{text!r:.60} is no robot and incarnation")
    return Origin(robot, incarnation)


def new_incarnation() -> str:
    """One that nobody has had."""
    return os.urandom(4).hex()


class Log:
    """A log in memory: its lines without their ends, and what proves them."""

    def __init__(self, origin: Origin) -> None:
        self.origin = origin
        self.lines: list[bytes] = []
        self.chains: list[bytes] = []  # of each line
        self.signatures: dict[int, bytes] = {}  # of the first so many lines

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def head(self) -> Head:
        """How far it goes."""
        return self.at(len(self))

    def at(self, length: int) -> Head:
        """How its first lines end."""
        return Head(length, self.chains[length - 1] if length else b"", self.signatures.get(length, b""))

    def write(self, record: dict[str, Any]) -> bytes:
        """The line that would add a record."""
        return link(self.head.chain, len(self), record)[0]

    def read(self, start: int, lines: Sequence[bytes]) -> tuple[list[dict[str, Any]], bytes]:
        """The records of those of the lines, numbered from `start`, that are new, and the last line's checksum.

        Nothing is added. Raises `ForkError` where they do not follow or are not what is known already, `ValueError`
        for what is no line.
        """
        if not 0 <= start <= len(self):
            raise ValueError(f"line {start} does not follow line {len(self) - 1}")
        if start + len(lines) > MOST_LINES or any(len(line) > LONGEST_LINE for line in lines):
            raise ValueError(f"more than {MOST_LINES} lines, or a line of more than {LONGEST_LINE} bytes")
        known = len(self) - start
        if [*lines[:known]] != self.lines[start : start + len(lines[:known])]:
            raise ForkError(f"{self.origin}: two logs that differ before line {len(self)}")
        chain, records = self.head.chain, []
        for number, line in enumerate(lines[known:], start=len(self)):
            try:
                body, chain = follow(chain, line)
            except ValueError as error:
                raise ForkError(f"{self.origin}: line {number} {error}") from None
            try:
                record = json.loads(body)
            except (ValueError, RecursionError):
                raise ValueError(f"{self.origin}: line {number} is no JSON") from None
            if record.get("seq") != number:
                raise ValueError(f"{self.origin}: line {number} has another number")
            records.append(record)
        return records, chain

    def add(self, start: int, lines: Sequence[bytes], signature: bytes = b"") -> list[bytes]:
        """Take over lines that `read` found right, and the signature of them all; those that are new."""
        new = [*lines[len(self) - start :]]
        for line in new:
            _, chain = follow(self.head.chain, line)
            self.lines.append(line)
            self.chains.append(chain)
        if signature:
            self.sign(start + len(lines), signature)
        return new

    def sign(self, length: int, signature: bytes) -> None:
        """Keep the signature of the first so many lines."""
        self.signatures[length] = signature
        for other in [n for n in self.signatures if n % SIGNED_EVERY and n < max(self.signatures)]:
            del self.signatures[other]


def read_lines(path: Path) -> tuple[list[bytes], int]:
    """The whole lines of a file, and the bytes of a torn last one. Raises `InputError` where it cannot be read."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the log: {error.strerror or error}") from None
    whole = content.rfind(b"\n") + 1
    return content[:whole].split(b"\n")[:-1], len(content) - whole
