"""One HTML file a survey: maps with a time slider, curves and tables, in the user's coordinates and units.

It opens from disk in any browser of today, and needs no network: program, style and data are in the file.
"""

import os

from maipp.files import write_atomic
from maipp.renamed import renamed
from maipp.team.broadcast import Broadcast
from maipp.viz.report_data import page_data
from maipp.viz.report_frames import frames_of
from maipp.viz.report_grid import map_grid
from maipp.viz.report_page import page, plotly_program
from maipp.viz.report_survey import Foreseen, SurveyReport

__all__ = ["Broadcast", "Foreseen", "SurveyReport", "report_html", "write_report"]


def report_html(report: SurveyReport) -> str:
    """The report as one HTML text of about 5 MB, almost all of it Plotly.

    Raises `InputError` where plotly is not installed, or the report's coordinates cannot be used.
    """
    plotly_program()  # before any work
    grid = map_grid(report)
    frames = frames_of(report, grid)
    return page(report, frames, page_data(report, grid, frames))


def write_report(path: str | os.PathLike[str], report: SurveyReport) -> None:
    """Write the report into an HTML file, all of it or nothing.

    Raises `InputError` where plotly is not installed, or the file cannot be written.
    """
    write_atomic(path, report_html(report))


renamed(__name__, Told="Broadcast")
