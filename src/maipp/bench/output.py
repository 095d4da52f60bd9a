"""CSV of results."""

import csv
import gzip
import io
from collections.abc import Iterable, Sequence
from typing import Any


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
