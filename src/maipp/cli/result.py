"""`maipp result`: what a survey took home, from its journal or its record: map, samples, report, numbers."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich import box
from rich.console import Console
from rich.table import Table

from maipp.cli.notes import results_console
from maipp.cli.scenario_flags import foresight_named
from maipp.errors import InputError

if TYPE_CHECKING:  # they import JAX, which `maipp result --help` can do without
    from maipp.results.result_files import Result as Written
    from maipp.scenario import Scenario
    from maipp.surveys.standardise import PreparedSurvey


@dataclass(frozen=True)
class ResultFlags:
    """Write what a survey took home (docs/live.md): map.tif, samples.csv, report.html and result.json.

    The journal may be in use: it is neither locked nor changed.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="JOURNAL|EPISODE")]
    """journal of a `maipp live`, or an episode.json, or the folder of one"""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("out/result")
    """folder to write to"""

    cells: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: 200)")] = None
    """cells along the longer side of the map"""

    foresight: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """add what this foresight expects of the true field to map and report, such as fitted (docs/foresight.md)"""

    mission: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """mission or scenario file of a journal that an earlier version wrote, which does not hold it"""


def run(flags: ResultFlags) -> int:
    """Read the survey, write the files, print the summary."""
    from maipp.results import read_taken, write_result
    from maipp.results.field_map import CELLS, FEWEST_CELLS, MOST_CELLS
    from maipp.results.sources import source_file

    cells = CELLS if flags.cells is None else flags.cells
    if not FEWEST_CELLS <= cells <= MOST_CELLS:
        raise InputError(f"--cells: {cells} is not a number of cells from {FEWEST_CELLS} to {MOST_CELLS}")
    foresight = foresight_named(flags.foresight)
    if source_file(flags.source).resolve().parent == flags.out.resolve():
        raise InputError(f"--out: {flags.out} is where {source_file(flags.source).name} is; give another folder")
    taken = read_taken(flags.source, _mission(flags.mission))
    with Console(stderr=True).status("drawing the map"):
        written = write_result(taken, flags.out, cells=cells, foresight=foresight)
    print_result(written, flags.out)
    return 0


def _mission(path: Path | None) -> "PreparedSurvey | Scenario | None":
    """The mission of an earlier journal, as `maipp live` reads it."""
    if path is None:
        return None
    from maipp.scenario_io import load_scenario
    from maipp.surveys.standardise import prepare
    from maipp.surveys.survey_io import is_mission, load_survey

    return prepare(load_survey(path)) if is_mission(path) else load_scenario(path)


def print_result(written: "Written", out: Path) -> None:
    """The summary of a result, on standard output."""
    from maipp.results.result_files import REPORT
    from maipp.results.result_text import kept_out_rows, robot_rows
    from maipp.viz.report_tables import TRACE

    told, console = written.numbers, results_console()
    for note in told["notes"]:
        console.print(f"warning: {note}", markup=False)
    console.print(told["title"], markup=False)
    for sentence in told["summary"]:
        console.print(sentence, markup=False)
    console.print(TRACE, markup=False)
    console.print(_table(robot_rows(told)))
    if rows := kept_out_rows(told):
        console.print("samples that do not count")
        console.print(_table(rows))
    for name in written.files:
        console.print(f"wrote {out / name}", markup=False)
    if REPORT not in written.files:
        print(f"left out {REPORT}: it needs plotly; install it with: pip install 'maipp[geo]'", file=sys.stderr)


def _table(rows: list[tuple[str, ...]]) -> Table:
    heading, *lines = rows
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in heading:
        table.add_column(name)
    for line in lines:
        table.add_row(*(cell.replace("[", "\\[") for cell in line))
    return table
