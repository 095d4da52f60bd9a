"""The files of compiled programs and of the calls they answer, in a folder below `devices.cache_folder`."""

import contextlib
import hashlib
import os
import secrets
import zlib
from pathlib import Path

from maipp.devices import cache_folder

_FOLDER = "programs"
_BEGIN = b"maipp program 1\n"
_DIGEST = hashlib.sha256().digest_size
_MOST_FILES, _MOST_BYTES = 200, 256 * 2**20  # of the folder; beyond, what was not used for longest goes


def folder() -> Path | None:
    """Where programs are kept; None where none are to be."""
    below = cache_folder()
    return None if below is None else below / _FOLDER


def read(name: str) -> bytes | None:
    """What is kept under a name; None where there is nothing, or nothing whole."""
    there = folder()
    if there is None:
        return None
    try:
        with open(there / name, "rb") as file:
            content = file.read() if _own(os.fstat(file.fileno())) else b""
        if not content.startswith(_BEGIN):
            return None
        digest, packed = content[len(_BEGIN) :][:_DIGEST], content[len(_BEGIN) + _DIGEST :]
        if hashlib.sha256(name.encode() + packed).digest() != digest:
            return None
        kept = zlib.decompress(packed)
    except (OSError, zlib.error):
        return None
    with contextlib.suppress(OSError):
        os.utime(there / name)  # it was of use now
    return kept


def write(name: str, content: bytes) -> None:
    """Keep the content under the name; a folder that cannot be written to keeps nothing."""
    there = folder()
    if there is None:
        return
    packed = zlib.compress(content, 1)
    temporary = there / f".{secrets.token_hex(8)}"
    try:
        there.mkdir(parents=True, exist_ok=True, mode=0o700)
        try:
            with open(temporary, "xb", opener=lambda path, flags: os.open(path, flags, 0o600)) as file:
                file.write(_BEGIN + hashlib.sha256(name.encode() + packed).digest() + packed)
            os.replace(temporary, there / name)
        finally:
            temporary.unlink(missing_ok=True)
        _make_room(there)
    except OSError:
        return


def _own(file: os.stat_result) -> bool:
    """Whether nobody but this user can have written it: to load a program is to run it."""
    return not hasattr(os, "geteuid") or (file.st_uid == os.geteuid() and not file.st_mode & 0o022)


def _make_room(there: Path) -> None:
    """Remove what was not used for longest where there is too much."""
    with os.scandir(there) as entries:
        files = sorted(((entry.stat().st_mtime, entry.stat().st_size, entry.path) for entry in entries), reverse=True)
    total = 0
    for number, (_, size, path) in enumerate(files):
        total += size
        if number and (number >= _MOST_FILES or total > _MOST_BYTES):
            with contextlib.suppress(OSError):
                os.unlink(path)
