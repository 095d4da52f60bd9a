"""The journal of a live survey: a file of JSON lines that survives a kill at any moment.

Each line starts with a checksum of itself and of the line before it, so a line that was damaged, removed or moved is
found. A line is on the disk (fsync) before `append` returns; one that a kill cut short is removed when the journal is
opened again, since nobody was answered from it. One process at a time holds the file's lock.
"""

import os
from pathlib import Path
from typing import Any, NamedTuple

from maipp.errors import InputError
from maipp.files import sync_folder
from maipp.live.chain import PREFIX, link, records_of


class Journal:
    """An open journal, positioned at its end. `records` are what it held when it was opened, header first."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open or create the journal and take its lock.

        Raises `InputError` where it cannot be opened, another process holds it, or a line is damaged.
        """
        self.path = Path(path)
        self.cut = 0  # bytes of a torn last line that were removed
        new = not self.path.exists()
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise InputError(f"{self.path}: cannot open the journal: {error.strerror or error}") from None
        try:
            self._lock()
            if new:
                sync_folder(self.path.parent)
            content = self._read()
            self.records, self._chain = records_of(content, self.path)
            self._count, self._size = len(self.records), len(content)
        except BaseException:
            self.close()
            raise

    def append(self, record: dict[str, Any]) -> None:
        """Add a record and wait until it is on the disk.

        Raises `InputError` where it cannot be written; the journal is then what it was, as after an interrupt.
        """
        line, chain = link(self._chain, self._count, record)
        line += b"\n"
        try:
            _write(self._file, line)
            os.fsync(self._file)
        except BaseException as error:  # an interrupt as well
            self._take_back()
            if isinstance(error, OSError):
                raise InputError(f"{self.path}: cannot write the journal: {error.strerror or error}") from None
            raise
        self._chain, self._size, self._count = chain, self._size + len(line), self._count + 1

    def _take_back(self) -> None:
        """Remove what a failed write left; where that fails as well, no later line may follow it."""
        try:
            os.ftruncate(self._file, self._size)
            os.fsync(self._file)
        except OSError:
            self.close()

    def close(self) -> None:
        """Release the lock and close the file; does nothing the second time."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _lock(self) -> None:
        try:
            import fcntl
        except ImportError:  # Windows has no such locks
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"{self.path}: another process is using this journal; stop it first") from None

    def _read(self) -> bytes:
        """The file's whole lines; what follows the last line end is cut away."""
        with open(self._file, "rb", closefd=False) as file:
            file.seek(0)
            content = file.read()
        whole = content[: content.rfind(b"\n") + 1]
        self.cut = len(content) - len(whole)
        if self.cut:
            if not content.startswith(PREFIX[: len(content)]):
                raise InputError(f"{self.path}: line 1 is no line of a journal; give another file")
            os.ftruncate(self._file, len(whole))
            os.fsync(self._file)
        return whole


class JournalCopy(NamedTuple):
    """What a journal held at one moment."""

    records: list[dict[str, Any]]  # header first
    torn: int  # bytes after the last whole line: one that a kill cut short, or that is being written


def read_journal(path: str | os.PathLike[str]) -> JournalCopy:
    """What the journal holds now: without its lock, whoever is writing to it, and without changing it.

    Raises `InputError` where it cannot be read, is none, or a line is damaged.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the journal: {error.strerror or error}") from None
    whole = content[: content.rfind(b"\n") + 1]
    records, _ = records_of(whole, Path(path))
    if not records:
        raise InputError(f"{path}: holds not one whole line of a journal; give the journal of a `maipp live`")
    return JournalCopy(records, len(content) - len(whole))


def _write(file: int, content: bytes) -> None:
    view = memoryview(content)
    while view:
        view = view[os.write(file, view) :]
