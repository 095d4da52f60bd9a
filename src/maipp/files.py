"""Files that are either whole or not there: written under a temporary name, then moved into place."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from maipp.errors import InputError


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path`, with its suffix, that replaces it when the block ends without an error.

    For writers that open the file themselves. On an error, an interrupt included, `path` is left as it was and the
    temporary file is removed. Raises `InputError` where the file cannot be written.
    """
    target = Path(path)
    # The suffix is kept: Pillow, Matplotlib and ffmpeg read the format from it.
    temporary = target.parent / f".{secrets.token_hex(8)}{target.suffix}"
    try:
        try:
            yield temporary
            with open(temporary, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror or error}") from error


def write_atomic(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Replace the file by this content (text as UTF-8, line ends as they are), or leave it untouched.

    Raises `InputError` where the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
