"""`maipp benchmark report`: the results of benchmarks on one page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.bench.page import write_report


@dataclass(frozen=True)
class ReportFlags:
    """Fill the places of a page with what benchmarks wrote, and copy their figures and raw numbers beside it."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DIR [DIR ...]")]
    """folders that `maipp benchmark` wrote to"""

    out: Annotated[Path, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: docs/evidence/tables.md)")] = Path(
        "docs/evidence/tables.md"
    )
    """page to fill, which has the lines <!-- NAME:start --> and <!-- NAME:end --> for each"""


def run(flags: ReportFlags) -> int:
    """Fill the page. Raises `InputError` for what is wrong."""
    written = write_report(flags.out, flags.runs)
    print(f"wrote {', '.join(written.places)} to {flags.out}")
    for path in written.files:
        print(f"wrote {path}")
    return 0
