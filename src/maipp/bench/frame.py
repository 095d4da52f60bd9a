"""What runs came to, as one tidy frame: a line for each mission, with what it was and all its metrics.

The columns, in this order, are those of NAME.csv.gz and of `maipp evaluate --csv`:

    table, row                     names; of tables only
    planner, options               its name, and options as one types them: of tables those that differ from the
                                   defaults, of evaluations all
    agents                         robots in the team
    budget, range, length_scale    of each agent (the largest); of communication, NaN where it is global; of the kernel:
                                   domain units
    seed                           of the worlds; of evaluations only
    KEY                            the scenario's key that a table's columns vary, where it is none of these
    instance, trial                number of the world, from 0, and of the run in it
    METRIC                         a column for each metric of the mission, in the precision it was computed in

The index is (part, column) of a table: the number of its part, and the value of the key in its column. Whatever is
shown of missions is taken from here: Markdown (`page`), CSV (`tidy_csv`), pictures (`drawings`).
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from maipp.bench.cells import CellResult, cell
from maipp.bench.command import Made
from maipp.bench.evaluate import Evaluation
from maipp.bench.tables import Row, SampleSize, TableSpec
from maipp.markdown import typed
from maipp.scenario import Scenario
from maipp.typing import Float

INDEX = ("part", "column")
_KEYS = ("agents", "budget", "comm_range", "length_scale")  # of the scenario, that are columns of every frame


class TableResults(NamedTuple):
    """The rows of a table of which every cell is there, and how they were made."""

    missions: pd.DataFrame  # as above
    made: tuple[Made, ...]  # machine and versions of each cell
    seconds: float  # that the cells took, times the devices they took them on


def read(table: TableSpec, folder: Path, sample: SampleSize) -> TableResults:
    """The rows of which the folder has every cell, made by the code and the weights of now."""
    frames, found = [], list[CellResult]()
    for number, part in enumerate(table.parts):
        for row in table.rows:
            line = {column: cell(table, part, row, column, sample).load(folder) for column in table.columns}
            results = {column: result for column, result in line.items() if result is not None}
            if len(results) == len(line):
                frames += [missions(table, number, row, column, result) for column, result in results.items()]
                found += results.values()
    return results_of(frames, found)


def results_of(frames: Sequence[pd.DataFrame], found: Sequence[CellResult]) -> TableResults:
    """The missions of several cells together."""
    whole = pd.concat(frames) if frames else pd.DataFrame()
    seconds = sum(result.wall_s * result.machine["devices"] for result in found)
    return TableResults(whole, tuple((result.machine, result.versions) for result in found), seconds)


def missions(table: TableSpec, part: int, row: Row, column: float, result: CellResult) -> pd.DataFrame:
    """The frame of one cell."""
    scenario = table.scenario(table.parts[part], column)
    about = {"table": table.name, "row": row.name, "planner": row.planner, "options": row.typed_options}
    about |= _of(scenario) | ({} if table.column in _KEYS else {table.column: column})
    return _tidy(dict(zip(INDEX, (part, column), strict=True)) | about, result).set_index([*INDEX])


def evaluated(evaluations: Sequence[Evaluation]) -> pd.DataFrame:
    """The frame of evaluations; a metric that some of them lack is NaN there."""
    frames = []
    for each in evaluations:
        options = " ".join(f"{key}={typed(value)}" for key, value in each.options.items())
        about = {"planner": each.planner, "options": options} | _of(each.scenario) | {"seed": each.seed}
        frames.append(_tidy(about, each, each.first))
    return pd.concat(frames, ignore_index=True)


def _of(scenario: Scenario) -> dict[str, Any]:
    reach = math.nan if scenario.comm_range is None else scenario.comm_range
    lengths = {"budget": max(scenario.budgets), "range": reach, "length_scale": scenario.length_scale}
    return {"agents": scenario.agents} | lengths


def _tidy(about: dict[str, Any], result: CellResult | Evaluation, first: int = 0) -> pd.DataFrame:
    """What the missions have in common, and the metrics of each; `first` is the number of the first instance."""
    made = result.machine.get("several", [result.machine])  # parts of one evaluation may come from several
    precision = np.float64 if any(machine.get("precision") == "float64" for machine in made) else np.float32
    instance, trial = np.indices(next(iter(result.values.values())).shape).reshape(2, -1)
    metrics = {metric: values.reshape(-1).astype(precision) for metric, values in result.values.items()}
    return pd.DataFrame(about | {"instance": first + instance, "trial": trial} | metrics)


def metrics_of(frame: pd.DataFrame) -> list[str]:
    """The names of the metrics: what comes after the trial."""
    names = [*frame.columns]
    return names[names.index("trial") + 1 :]


def grouped(frame: pd.DataFrame, *by: str) -> list[tuple[Any, pd.DataFrame]]:
    """The lines that are equal in these columns or levels of the index, with what they have there; in order."""
    groups = frame.groupby([*by], sort=False)
    return [(key if len(by) > 1 else key[0], group) for key, group in groups]  # pyright: ignore[reportIndexIssue]


def grids(
    frame: pd.DataFrame, metric: str, by: Sequence[str] = ("row", "column")
) -> dict[tuple[Any, ...], Float[np.ndarray, "instances trials"]]:
    """A metric of each group of missions."""
    return {
        key: group.pivot(index="instance", columns="trial", values=metric).to_numpy(np.float64)
        for key, group in grouped(frame, *by)
    }


def wide(values: Mapping[tuple[Any, ...], Any]) -> pd.DataFrame:
    """What there is of each group, the last part of its key across; empty text where there is nothing."""
    index = pd.MultiIndex.from_tuples([*values])
    return pd.DataFrame(pd.Series([*values.values()], index, dtype=object).unstack(sort=False, fill_value=""))
