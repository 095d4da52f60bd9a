"""Files of results: a folder for them, and CSV."""

import csv
import gzip
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from maipp.errors import InputError


def make_folder(folder: Path) -> None:
    """Make the folder where it is missing. Raises `InputError` where that cannot be done."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror or error}") from error


def csv_text(heading: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """A line for the heading and one for each row."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heading)
    writer.writerows(rows)
    return text.getvalue()


def compressed(text: str) -> bytes:
    """The text as gzip without a time in it: the same numbers are the same bytes."""
    return gzip.compress(text.encode("utf-8"), compresslevel=9, mtime=0)
