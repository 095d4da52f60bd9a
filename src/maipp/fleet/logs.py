"""All logs that a robot knows, its own and those it carries for others, in a folder."""

import contextlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from maipp.errors import InputError
from maipp.files import sync_folder, write_atomic
from maipp.fleet.log import SIGNED_EVERY, ForkError, Head, Log, Origin, new_incarnation, read_lines, read_origin
from maipp.fleet.seal import Seal, Unsealed
from maipp.live.chain import follow, sum_of
from maipp.live.journal import Journal
from maipp.renamed import renamed

# Most logs that are kept of all robots together: somebody who makes up incarnations must not fill the disk.
MOST_LOGS = 2000

_SUFFIX, _SIGNATURES, _LOCK = ".log", ".signatures", "lock"


class LogSegment(NamedTuple):
    """Consecutive lines of a log, and the signature of all up to the last of them."""

    origin: Origin
    start: int
    lines: list[bytes]
    signature: bytes


class Logs:
    """The logs, in memory and on the disk. Safe for use by several threads.

    Lines of one's own are on the disk (fsync) before `append` returns; those of others are written without waiting:
    who has lost them asks again.
    """

    def __init__(
        self,
        folder: Path | None,
        robot: str | None,
        mission: str,
        *,
        seal: Seal | None = None,
        incarnation: str | None = None,
        tell: Callable[[str], None] = print,
    ) -> None:
        """Read what is in the folder, and begin a log of one's own if `robot` is given.

        Nothing is written without a folder. `mission` is the survey's digest: logs of another mission are refused, by
        `InputError`, as is a folder that another process uses.
        """
        self.folder, self.mission, self.seal, self._tell = folder, mission, seal or Unsealed(), tell
        self.known: dict[Origin, Log] = {}
        self.forked: set[Origin] = set()
        self._files: dict[Origin, int] = {}
        self.lock = RLock()
        self._own: Journal | None = None
        self._held: int | None = None
        self.origin = None if robot is None else Origin(robot, incarnation or new_incarnation())
        try:
            if folder is not None:
                self._open(folder)
        except BaseException:
            self.close()
            raise

    # What is known.

    def heads(self) -> dict[Origin, Head]:
        """How far every log goes."""
        with self.lock:
            return {origin: log.head for origin, log in self.known.items() if len(log)}

    def records(self, robot: str | None = None) -> list[tuple[Origin, dict[str, Any]]]:
        """The records of all logs, or of one robot's, without their headers."""
        with self.lock:
            chosen = sorted(origin for origin in self.known if robot in (None, origin.robot))
            return [(origin, json.loads(line)) for origin in chosen for line in self.known[origin].lines[1:]]

    def part(self, origin: Origin, start: int, most: int) -> LogSegment | None:
        """Lines of a log from `start` on, of some `most` bytes at least one line; None where there are none.

        They end where the log does or where its robot has signed it.
        """
        with self.lock:
            log = self.known.get(origin)
            if log is None or not 0 <= start < len(log):
                return None
            end, size = start, 0
            while end < len(log) and (end == start or size + len(log.lines[end]) <= most):
                size += len(log.lines[end])
                end += 1
            signed = [length for length in log.signatures if start < length <= end]
            if log.signatures and end < len(log):
                later = [length for length in log.signatures if length > start]
                end = max(signed) if signed else min(later, default=len(log))
            return LogSegment(origin, start, log.lines[start:end], log.at(end).signature)

    def length(self, origin: Origin) -> int:
        """Lines that are known of a log."""
        with self.lock:
            return len(self.known[origin]) if origin in self.known else 0

    def agrees(self, origin: Origin, head: Head) -> bool:
        """Whether somebody's log is the same as ours as far as both go, as far as can be told."""
        with self.lock:
            log = self.known.get(origin)
            return log is None or head.length > len(log) or log.at(head.length).chain == head.chain

    # What is added.

    def append(self, record: dict[str, Any]) -> LogSegment:
        """Add a record to one's own log; what is new of it, with the first record the header too.

        Raises `DiskError` where it cannot be written; nothing has changed then.
        """
        with self.lock:
            if self.origin is None:
                raise InputError("who only watches has no log of its own")
            try:
                start = self.length(self.origin)
                if not start:
                    self._begin(self.origin)
                log = self.known[self.origin]
                signature = self._write(log, record)
                return LogSegment(self.origin, start, log.lines[start:], signature)
            except InputError as error:
                raise DiskError(str(error)) from None
            except OSError as error:
                raise DiskError(f"{self.folder}: cannot write the log: {error.strerror or error}") from None

    def extend(self, part: LogSegment) -> list[dict[str, Any]]:
        """The new records of a part of somebody's log, once it is taken over.

        Raises `ForkError` where it contradicts what is known, `ValueError` for what is no part of a log of this
        mission, or not proved to be its robot's. Nothing has changed then.
        """
        origin, start, lines, signature = part
        with self.lock:
            if origin == self.origin:
                if not self.proves_fork(part):
                    raise ValueError(f"{origin}: not signed by {origin.robot}")
                raise ForkError(f"{origin}: somebody else writes the log of this robot")
            log = self.known.get(origin) or Log(origin)
            if origin not in self.known and len(self.known) >= MOST_LOGS:
                raise ValueError(f"{origin}: more than {MOST_LOGS} logs")
            try:
                records, chain = log.read(start, lines)
            except ForkError:
                if not self.proves_fork(part):
                    raise ValueError(f"{origin}: not signed by {origin.robot}") from None
                self.forked.add(origin)
                raise
            if not records:
                return []
            self._check(origin, records, start + len(lines), chain, signature)
            new = log.add(start, lines, signature)
            self.known[origin] = log
            self._keep(log, new)
            return records[1:] if records[0]["seq"] == 0 else records

    def proves_fork(self, part: LogSegment) -> bool:
        """Whether a robot has signed these lines, and has written others; without signatures, True.

        Who only carries lines may have made them up. Checksums lead back from the one that is signed, so that all are
        as they were signed, but for the text of the first.
        """
        origin, start, lines, signature = part
        if isinstance(self.seal, Unsealed):
            return True
        sums, known = [sum_of(line) for line in lines], self.known.get(origin, Log(origin)).chains
        try:
            for before, line in zip(sums, lines[1:], strict=False):
                follow(before, line)
        except ValueError:
            return False
        end = start + len(lines)
        differs = any(ours != theirs for ours, theirs in zip(known[start:end], sums, strict=False))
        longer = origin == self.origin and end > len(known)
        return (differs or longer) and self.seal.check(origin, Head(end, sums[-1], signature))

    def _check(
        self, origin: Origin, records: Sequence[dict[str, Any]], end: int, chain: bytes, signature: bytes
    ) -> None:
        """Raise `ValueError` for lines of another mission, and for those that their robot has not signed."""
        if records[0]["seq"] == 0:
            check_header(records[0], origin, self.mission)
        if not self.seal.check(origin, Head(end, chain, signature)):
            raise ValueError(f"{origin}: not signed by {origin.robot}")

    def _begin(self, origin: Origin) -> None:
        """Begin one's own log with its header."""
        if self.folder is not None:
            self._own = Journal(self._path(origin))
        log = Log(origin)
        try:
            self._write(log, {"log": FORMAT, **origin._asdict(), "mission": self.mission})
        except BaseException:
            if self._own is not None:
                self._own.close()
            raise
        self.known[origin] = log

    def _write(self, log: Log, record: dict[str, Any]) -> bytes:
        """Add a record; the signature of the log with it."""
        line, start = log.write(record), len(log)
        if self._own is not None:
            self._own.append(record)
        log.add(start, [line])
        signature = self.seal.sign(log.origin, log.head)
        if signature:
            log.sign(len(log), signature)
            self._keep_signature(log, len(log), signature)
        return signature

    # The folder.

    def _path(self, origin: Origin) -> Path:
        assert self.folder is not None
        return self.folder / f"{origin}{_SUFFIX}"

    def _open(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._held = _locked(folder / _LOCK)
            paths = sorted(folder.glob(f"*{_SUFFIX}"))
        except OSError as error:
            raise InputError(f"{folder}: cannot be used for logs: {error.strerror or error}") from None
        for path in paths:
            try:
                origin = read_origin(path.name.removesuffix(_SUFFIX))
            except ValueError:
                continue
            self._read(path, origin)

    def _read(self, path: Path, origin: Origin) -> None:
        """Take up a log of the folder; of a damaged one the lines before the damage."""
        lines, torn = read_lines(path)
        log, problem = Log(origin), ""
        for number, line in enumerate(lines):
            try:
                ((record,), _) = log.read(number, [line])
                if number == 0:
                    check_header(record, origin, self.mission)
            except OtherMissionError as error:
                raise InputError(f"{path}: {error}; give each mission a folder of its own") from None
            except ValueError as error:
                problem = str(error)
                break
            log.add(number, [line])
        with contextlib.suppress(OSError, ValueError):
            for row in self._path(origin).with_suffix(_SIGNATURES).read_text("ascii").splitlines():
                length, signature = row.split()
                if 0 < int(length) <= len(log):
                    log.sign(int(length), bytes.fromhex(signature))
        if problem:
            kept = path.with_suffix(".damaged")
            os.replace(path, kept)
            self._tell(f"{problem}; the file is kept as {kept.name}, and the rest is asked of others")
        if problem or torn:
            write_atomic(path, b"".join(line + b"\n" for line in log.lines))
        if len(log):
            self.known[origin] = log

    def _keep(self, log: Log, lines: Sequence[bytes]) -> None:
        if self.folder is None:
            return
        if log.origin not in self._files:
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
            self._files[log.origin] = os.open(self._path(log.origin), flags, 0o644)
        content = memoryview(b"".join(line + b"\n" for line in lines))
        while content:
            content = content[os.write(self._files[log.origin], content) :]
        for length, signature in log.signatures.items():
            if len(log) - len(lines) < length:
                self._keep_signature(log, length, signature)

    def _keep_signature(self, log: Log, length: int, signature: bytes) -> None:
        """Beside the log: those of every so many lines, and the last."""
        if self.folder is None:
            return
        path = self._path(log.origin).with_suffix(_SIGNATURES)
        try:
            with open(path, "a", encoding="ascii") as file:
                file.write(f"{length} {signature.hex()}\n")
            if length % SIGNED_EVERY == 0:
                rows = "".join(f"{n} {s.hex()}\n" for n, s in sorted(log.signatures.items()))
                write_atomic(path, rows)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None

    def close(self) -> None:
        """Release files and folder; does nothing the second time."""
        with self.lock:
            if self._own is not None:
                self._own.close()
            for file in self._files.values():
                os.close(file)
            self._files.clear()
            if self._held is not None:
                os.close(self._held)
                self._held = None


FORMAT = "maipp.fleet/1"


class DiskError(InputError):
    """One's own log cannot be written now."""


class OtherMissionError(ValueError):
    """A log of another mission."""


def check_header(header: dict[str, Any], origin: Origin, mission: str) -> None:
    """Raise `ValueError` for the first line of what is no log of this robot and mission."""
    if header.get("log") != FORMAT or (header.get("robot"), header.get("incarnation")) != origin:
        raise ValueError(f"{origin}: line 0 is no header of this log")
    if header.get("mission") != mission:
        raise OtherMissionError(f"{origin}: a log of another mission, planner, seed or epoch")


def _locked(path: Path) -> int:
    """The open lock file. Raises `InputError` where another process holds it."""
    file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        return file
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(file)
        raise InputError(f"{path.parent}: another process uses this folder; stop it, or give another") from None
    sync_folder(path.parent)
    return file


renamed(__name__, Part="LogSegment")
