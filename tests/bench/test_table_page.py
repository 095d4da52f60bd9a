"""The files of a table: golden Markdown, tidy CSV, a figure with every number."""

import csv
import dataclasses
import gzip
import io
from pathlib import Path

import numpy as np
import pytest

from maipp.bench.cells import CellResult
from maipp.bench.drawings import draw_table
from maipp.bench.frame import missions, results_of
from maipp.bench.table_page import table_page
from maipp.bench.tables import TABLES, SampleSize
from maipp.bench.tidy_csv import compressed, missions_csv

GOLDEN = Path(__file__).parent / "golden"
SAMPLE = SampleSize(instances=4, trials=2, seed=1)
MACHINE = {"cpu": "A processor", "cores": 2, "backend": "cpu", "devices": 2, "precision": "float32"}
VERSIONS = {"maipp": "0.1.0", "jax": "0.10.2", "python": "3.11.7"}


def result(seed: int, scale: float, trials: int) -> CellResult:
    """Made-up values that any NumPy makes alike: no random generator."""
    grid = np.arange(SAMPLE.instances * trials, dtype=np.float64).reshape(SAMPLE.instances, trials)
    wave = 1 + 0.25 * np.cos(1.7 * grid + seed)
    metrics = {"trace": 1.0, "own_trace": 1.25, "true_trace": 0.25, "rmse": 0.005, "distance": 2.0, "decisions": 4.0}
    return CellResult({name: share * scale * wave for name, share in metrics.items()}, 30.0, MACHINE, VERSIONS)


@pytest.fixture(scope="module")
def table():
    table = TABLES["table4"]
    rows = tuple(row for row in table.rows if row.name in ("ti-5-star", "greedy", "receding-horizon-joint"))
    return dataclasses.replace(table, rows=rows, parts=table.parts[::2])


@pytest.fixture(scope="module")
def found(table):
    """What each cell came to, by part, row and budget."""
    scales = {"ti-5-star": 20.0, "greedy": 40.0, "receding-horizon-joint": 9.0}
    return {
        (number, row.name, b): result(i + int(b), scales[row.name] / b, min(2, row.trials or 2))
        for number in range(len(table.parts))
        for i, row in enumerate(table.rows)
        for b in table.columns
    }


def together(table, found):
    rows = {row.name: row for row in table.rows}
    frames = [missions(table, part, rows[row], b, result) for (part, row, b), result in found.items()]
    return results_of(frames, [*found.values()])


@pytest.fixture(scope="module")
def results(table, found):
    return together(table, found)


def test_the_page_is_as_agreed(table, results):
    page = table_page(table, results, SAMPLE, out="run", reference="ti-5-star", files=("table4.png", "table4.csv.gz"))
    assert page == (GOLDEN / "table4.md").read_text(encoding="utf-8")


def test_the_wall_time_is_on_a_line_of_its_own(table, found):
    def page(wall_s):
        slow = {cell: dataclasses.replace(result, wall_s=wall_s) for cell, result in found.items()}
        return table_page(table, together(table, slow), SAMPLE, out="run", reference="ti-5-star").splitlines()

    differing = [a for a, b in zip(page(60.0), page(600.0), strict=True) if a != b]
    assert len(differing) == 1 and differing[0].startswith("*Wall time times devices, which does not regenerate:")


def test_every_mission_is_one_line_of_csv(table, found, results):
    text = missions_csv(results.missions)
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 2 * 3 * (8 + 8 + 4)  # parts, budgets; missions of the three rows, one of which has one trial
    for (number, row, budget), one in found.items():
        reach = table.parts[number].scenario.comm_range
        about = (row, "" if reach is None else str(reach), budget)
        mine = [r for r in rows if (r["row"], r["range"], float(r["budget"])) == about]
        assert len(mine) == one.values["trace"].size
        for metric, values in one.values.items():
            for line in mine:
                assert np.float32(line[metric]) == np.float32(values[int(line["instance"]), int(line["trial"])])
    first = rows[0]
    assert (first["table"], first["planner"], first["agents"], first["length_scale"]) == (
        "table4",
        "ti-star",
        "3",
        "0.45",
    )
    assert first["options"] == "paths=8 steps=5"


def test_the_same_numbers_are_the_same_bytes(table, results):
    text = missions_csv(results.missions)
    assert compressed(text) == compressed(text) and gzip.decompress(compressed(text)).decode() == text
    assert compressed(text)[4:8] == bytes(4)  # no time of writing


def test_the_figure_shows_every_number(table, found, results):
    figure, papers = draw_table(table, results.missions), {row.name: row.paper for row in table.rows}
    for number, (axes, part) in enumerate(zip(figure.axes, table.parts, strict=True)):
        shown = [float(x) for line in axes.lines for x in np.asarray(line.get_xdata(), float)]
        for (which, row, budget), one in found.items():
            if which == number:
                assert min(abs(one.values["own_trace"].mean() - x) for x in shown) < 1e-5
                if papers[row] in part.printed:
                    assert part.printed[papers[row]][budget].mean in shown
