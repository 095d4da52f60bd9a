"""The files of a result: the map, the samples, the report and the numbers, all of them or none."""

import json
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from maipp.files import staged_folder, write_atomic
from maipp.foresight import ForesightName
from maipp.results.field_map import CELLS, field_map
from maipp.results.geotiff import load_rasterio, write_geotiff
from maipp.results.numbers import numbers
from maipp.results.result_text import came_home, kept_out_rows, sentences
from maipp.results.samples_csv import samples_csv
from maipp.results.taken import Taken

MAP, SAMPLES, REPORT, NUMBERS = "map.tif", "samples.csv", "report.html", "result.json"


class Result(NamedTuple):
    """What was written."""

    numbers: dict[str, Any]  # as in result.json
    files: tuple[str, ...]  # names; without the report where plotly is not installed


def write_result(
    taken: Taken, folder: str | os.PathLike[str], *, cells: int = CELLS, foresight: ForesightName | None = None
) -> Result:
    """Write map.tif, samples.csv, report.html and result.json into the folder, made if need be; older ones go.

    `cells` is the number of cells along the longer side of the map. Map and report have what a `foresight` expects of
    the true field as well, if one is named. Without plotly there is no report.
    Raises `InputError` where rasterio is missing and where the folder cannot be written to, which is then as it was.
    """
    load_rasterio()  # before any work
    with staged_folder(folder, gone=(REPORT,)) as stage:
        drawn = field_map(taken, cells, foresight)
        told = numbers(taken, drawn)
        files = [MAP, SAMPLES, *([REPORT] if find_spec("plotly") is not None else []), NUMBERS]
        told |= {"summary": sentences(told), "files": files}
        write_geotiff(stage / MAP, drawn, taken.frame.unit)
        write_atomic(stage / SAMPLES, samples_csv(taken))
        if REPORT in files:
            _write_report(stage / REPORT, taken, told, foresight)
        write_atomic(stage / NUMBERS, json.dumps(told, indent=2, allow_nan=False) + "\n")
    return Result(told, tuple(files))


def _write_report(path: Path, taken: Taken, told: dict[str, Any], foresight: ForesightName | None) -> None:
    from maipp.results.foreseen import foreseen
    from maipp.viz.report import SurveyReport, write_report

    unit = told["units"]["length"]
    report = SurveyReport(
        taken.episode,
        title=taken.title,
        date=taken.date,
        names=tuple(robot.name for robot in taken.robots),
        seconds_per_time=taken.seconds_per_time,
        area=taken.area,
        no_go=taken.no_go if taken.area is not None else None,
        truth_known=taken.truth_known,
        warnings=taken.notes,
        summary=tuple(told["summary"]),
        homes=tuple(came_home(robot, unit) for robot in told["robots"]),
        kept_out=tuple(kept_out_rows(told)),
        foreseen=None if foresight is None else foreseen(taken.episode, taken.belief, foresight),
    )
    write_report(path, report)
