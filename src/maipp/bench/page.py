"""Pages of results: frames as tables, and the report that puts the pages of several runs together.

Every benchmark writes DIR/NAME.md, whose links lead to files beside it. The report keeps a place for each NAME, between
the lines `<!-- NAME:start -->` and `<!-- NAME:end -->`; the text around these places is never touched.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from maipp.bench.evaluate import summarise
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.markdown import filled, markdown_table, mean_and_error
from maipp.typing import Float

MOST_BYTES = 3_000_000  # of all raw numbers beside the page: they are kept in the repository

_LINK = re.compile(r"\]\(([^)\s:#]+)\)")

METRICS = {
    "trace": "Tr(P)",
    "own_trace": "Tr(P) of the agents' own beliefs",
    "true_trace": "Tr(P) over the true high-interest area",
    "rmse": "RMSE",
    "unspent": "budget left",
    "distance": "distance travelled",
    "decisions": "decisions",
}


def shown(values: Float[np.ndarray, "instances trials"]) -> str:
    """Mean and standard error over instances, of all values."""
    summary = summarise(values)
    return mean_and_error(summary.mean, summary.se)


def markdown(frame: pd.DataFrame, columns: Mapping[str, str] | None = None, left: int = 1) -> str:
    """The frame without its index as a table; its first `left` columns, of words, are aligned to the left.

    `columns` are by their headings what they tell of a line, such as `{trace:.1f}`; without them all is text already.
    """
    if columns is None:
        return markdown_table([*frame.columns], frame.to_numpy(object).tolist(), left)
    lines = ([told.format_map(line) for told in columns.values()] for line in frame.to_dict("records"))
    return markdown_table([*columns], lines, left)


class Written(NamedTuple):
    """What a report consists of."""

    places: tuple[str, ...]  # filled, by name
    files: tuple[Path, ...]  # copied beside the page


def write_report(page: Path, runs: Sequence[Path]) -> Written:
    """Fill the places on the page from the runs, and copy the files they link to into the folder named as the page.

    Raises `InputError` for a page without a place for something, a folder without results, two folders with results
    of one name, a link that leads nowhere, and more raw numbers than a repository should hold.
    """
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{page}: cannot be read: {error.strerror or error}; give a page that has places") from None
    beside = page.parent / page.stem
    sections = _sections(runs)
    for name, path in sections.items():
        section = _LINK.sub(rf"]({beside.name}/\1)", path.read_text(encoding="utf-8")).strip()
        text = filled(text, f"<!-- {name}:start -->", f"<!-- {name}:end -->", section, page, path)
    copies = {beside / link: source for path in sections.values() for link, source in _linked(path).items()}
    _check_size(beside, copies)
    for target, source in copies.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(target, source.read_bytes())
    write_atomic(page, text)
    return Written(tuple(sections), tuple(copies))


def _sections(runs: Sequence[Path]) -> dict[str, Path]:
    """The Markdown of every benchmark in the runs, by name."""
    found: dict[str, Path] = {}
    for run in runs:
        pages = sorted(run.glob("*.md"))
        if not pages:
            raise InputError(f"{run}: holds no results; give folders that `maipp benchmark` wrote")
        for path in pages:
            if path.stem in found:
                raise InputError(f"{path.stem}: is in {found[path.stem].parent} and in {run}; give one of them")
            found[path.stem] = path
    return found


def _linked(path: Path) -> dict[str, Path]:
    """The files that a page of results links to, by the link."""
    links = dict.fromkeys(_LINK.findall(path.read_text(encoding="utf-8")))
    for link in links:
        if not (path.parent / link).is_file():
            raise InputError(f"{path}: links to {link}, which is not there; run its command again")
    return {link: path.parent / link for link in links}


def _check_size(beside: Path, copies: dict[Path, Path]) -> None:
    raw = {path: path.stat().st_size for path in beside.glob("*.gz")}
    raw |= {target: source.stat().st_size for target, source in copies.items() if target.suffix == ".gz"}
    if sum(raw.values()) > MOST_BYTES:
        raise InputError(f"{beside}: {sum(raw.values()):,} bytes of raw numbers; at most {MOST_BYTES:,} are kept")
