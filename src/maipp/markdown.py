"""Markdown that commands write: numbers, tables, and the places on a page that they fill."""

import math
from collections.abc import Iterable, Sequence

from maipp.errors import InputError


def three(value: float) -> str:
    """Three significant digits."""
    return f"{value:#.3g}".rstrip(".")


def mean_and_error(mean: float, se: float | None) -> str:
    """`36.1 ± 1.2`: the error to two significant digits, the mean to the same place; three digits without an error."""
    if se is None or not se > 0:
        return three(mean)
    decimals = max(0, 1 - math.floor(math.log10(se)))
    return f"{mean:.{decimals}f} ± {se:.{decimals}f}"


def markdown_table(heading: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """A table; its first `left` columns are aligned to the left, the others, of numbers, to the right."""
    ruler = ["---"] * left + ["---:"] * (len(heading) - left)
    return "\n".join(f"| {' | '.join(row)} |" for row in [heading, ruler, *rows])


def filled(text: str, start: str, end: str, content: str, page: object = "the page", what: object = "the table") -> str:
    """The page's text with the content between two marker lines.

    Raises `InputError` where the lines are missing; `page` and `what` say which page, and what has no place on it.
    """
    before, found, rest = text.partition(start)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise InputError(f"{page}: no place for {what}; add the lines {start} and {end} to it")
    return f"{before}{start}\n\n{content}\n\n{end}{after}"


def typed(value: object) -> str:
    """A value as one types it after `--set`."""
    if isinstance(value, list | tuple):
        return ",".join(map(typed, value))
    return str(value).lower() if value is None or isinstance(value, bool) else str(value)
