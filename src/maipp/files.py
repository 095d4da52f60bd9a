"""Files that are either whole or not there: written under a temporary name, then moved into place."""

import os
import secrets
import shutil
import tempfile
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


@contextmanager
def staged_folder(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary folder in `folder`, made if need be, whose files move there together when the block ends well.

    On an error, an interrupt included, nothing in `folder` changes. Raises `InputError` where it is a file or cannot
    be written to.
    """
    target = Path(folder)
    if target.exists() and not target.is_dir():
        raise InputError(f"{target}: is a file; give a folder")
    try:
        target.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".", dir=target))
    except OSError as error:
        raise InputError(f"{target}: cannot be written to: {error.strerror or error}") from error
    try:
        yield stage
        for path in sorted(stage.iterdir()):
            try:
                os.replace(path, target / path.name)
            except OSError as error:  # a folder of that name
                raise InputError(f"{target / path.name}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)
