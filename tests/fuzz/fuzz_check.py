"""What a reader of people's files may do: return, or raise `InputError` of exactly one line that names the file.

It must never raise anything else, return a number that is not finite, or leave a file behind.
"""

import dataclasses
import math
import os
import tempfile
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maipp.errors import InputError


@dataclass(frozen=True)
class Target:
    """One reader with good inputs to start from."""

    suffix: str  # of the file that it reads
    read: Callable[[Path], Any]
    seeds: Callable[[], list[bytes]]  # good inputs, which are mutated
    tokens: tuple[bytes, ...] = ()  # words that mean something in the format
    pack: Callable[[bytes], bytes] = bytes  # what is done to the mutated bytes before they are written
    slice: int = 2000  # how many inputs the test suite tries; fewer for slow readers
    named: bool = True  # whether its errors name the file


class Failure(AssertionError):  # noqa: N818 - it is not an error but a finding
    """A reader did what it must not."""


def check(target: Target, data: bytes, folder: Path) -> bool:
    """Whether the reader accepts the input; raises `Failure` where it does what it must not."""
    path = folder / f"input{target.suffix}"
    path.write_bytes(target.pack(data))
    before = sorted(folder.iterdir())
    try:
        answer = target.read(path)
    except InputError as error:
        message = str(error)
        if len(message.splitlines()) != 1 or any(unicodedata.category(c) == "Cc" for c in message):
            raise Failure(f"not one plain line: {message!r}") from error
        if target.named and str(path.with_suffix("")) not in message:  # or the file that belongs to it
            raise Failure(f"does not name the file: {message!r}") from error
        if len(message) > 2000:
            raise Failure(f"a message of {len(message)} characters: {message[:100]!r}") from error
        return False
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        raise Failure(f"{type(error).__name__}: {str(error)[:300]}") from error
    finally:
        left = [item.name for item in folder.iterdir() if item not in before]
    if left:
        raise Failure(f"left behind: {left}")
    if (where := not_finite(answer, type(answer).__name__)) is not None:
        raise Failure(f"{where} is not finite")
    return True


def working_folder() -> tempfile.TemporaryDirectory[str]:
    """A folder for `check`, in memory where there is such a place: every input is a file or two."""
    memory = Path("/dev/shm")
    return tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None)


def not_finite(value: Any, name: str) -> str | None:
    """The path of the first number in the answer that is NaN or infinite, if any."""
    if isinstance(value, float):
        return None if math.isfinite(value) else name
    if isinstance(value, np.ndarray):
        return None if value.dtype.kind not in "fc" or np.isfinite(value).all() else name
    parts: list[tuple[str, Any]] = []
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = [(f".{field.name}", getattr(value, field.name)) for field in dataclasses.fields(value)]
    elif isinstance(value, Mapping):
        parts = [(f"[{key!r}]", item) for key, item in value.items()]
    elif isinstance(value, list | tuple):
        parts = [(f"[{i}]", item) for i, item in enumerate(value)]
    return next((found for part, item in parts if (found := not_finite(item, name + part)) is not None), None)
