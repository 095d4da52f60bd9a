"""Frames as CSV."""

import gzip
from collections.abc import Callable, Mapping
from typing import Any

import pandas as pd

from maipp.bench.frame import metrics_of


def csv_text(frame: pd.DataFrame, formats: Mapping[str, Callable[[Any], str]] | None = None) -> str:
    """A line for the names of the columns and one for each line of the frame, without its index.

    A number has the fewest digits that give it again at its own precision, where there is no format for its column.
    """
    own = formats or {}
    texts = {name: [own.get(name, str)(value) for value in frame[name].to_numpy()] for name in frame}
    return pd.DataFrame(texts).to_csv(index=False, lineterminator="\n")


def missions_csv(frame: pd.DataFrame) -> str:
    """The missions of a frame (`maipp.bench.frame`); an empty range is global communication, an empty metric none."""
    metrics = metrics_of(frame)
    own: dict[str, Callable[[Any], str]] = {name: short for name in frame if frame[name].dtype.kind == "f"}
    own |= dict.fromkeys(metrics, lambda value: "" if value != value else str(value).removesuffix(".0"))
    return csv_text(frame, own)


def short(value: float) -> str:
    """Six significant digits at most; nothing for NaN."""
    return "" if value != value else f"{value:g}"


def compressed(text: str) -> bytes:
    """The text as gzip without a time in it: the same numbers are the same bytes."""
    return gzip.compress(text.encode("utf-8"), compresslevel=9, mtime=0)
