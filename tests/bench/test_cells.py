"""Filling a table: nothing twice, nothing stale, nothing lost but the cell that an interrupt meets."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.bench import cells as cells_module
from maipp.bench.cells import CELLS, Cell, cells, fill, share
from maipp.bench.frame import grids, read
from maipp.bench.tables import Row, SampleSize
from maipp.errors import InputError
from maipp.problem import shape_of
from maipp.scenario import Scenario

SAMPLE = SampleSize(instances=2, trials=2, seed=3)
ROWS = ("random", "greedy", "lawnmower")


@pytest.fixture(scope="module")
def every(tiny_table):
    return list(cells(tiny_table, tiny_table.rows, SAMPLE))


@pytest.fixture(scope="module")
def filled(every, tmp_path_factory):
    folder = tmp_path_factory.mktemp("filled")
    assert fill(every, folder) == len(every)
    return folder


def numbers(folder, table):
    found = grids(read(table, folder, SAMPLE).missions, "own_trace", ("part", "row", "column"))
    return {cell: values.tolist() for cell, values in found.items()}


def copy(filled, folder, names):
    (folder / CELLS).mkdir(parents=True)
    for name in names:
        (folder / CELLS / name).write_bytes((filled / CELLS / name).read_bytes())


def test_every_row_part_and_budget_has_its_cell(every, filled, tiny_table):
    assert len(every) == 3 * 2 * 2 == len(list((filled / CELLS).iterdir()))
    assert list(numbers(filled, tiny_table)) == [(p, r, b) for p in (0, 1) for r in ROWS for b in (2.0, 3.0)]
    values = every[0].load(filled).values
    assert all(array.shape == (2, 2) and np.isfinite(array).all() for array in values.values())
    metrics = {"trace", "own_trace", "true_trace", "rmse", "distance", "decisions", "unspent"}
    assert metrics | {"not_finite", "record_full"} == values.keys()


def test_a_full_folder_is_not_computed_again(every, filled, monkeypatch):
    monkeypatch.setattr(cells_module, "evaluate", lambda *_, **__: pytest.fail("computed again"))
    assert fill(every, filled) == 0


def test_an_interrupt_in_mid_cell_loses_that_cell_alone(every, filled, tiny_table, tmp_path, monkeypatch):
    original, begun = cells_module.evaluate, []

    def killed(*inputs, progress=None, **named):
        begun.append(inputs)
        if len(begun) == 3:
            raise KeyboardInterrupt
        return original(*inputs, progress=progress, **named)

    monkeypatch.setattr(cells_module, "evaluate", killed)
    with pytest.raises(KeyboardInterrupt):
        fill(every, tmp_path)
    assert sorted(path.name for path in (tmp_path / CELLS).iterdir()) == sorted(one.file for one in every[:2])
    # What a kill leaves of a file that was being written has another name.
    (tmp_path / CELLS / ".0123456789abcdef.json").write_text('{"format": "maipp-c', encoding="utf-8")
    assert fill(every, tmp_path) == len(every) - 2
    assert numbers(tmp_path, tiny_table) == numbers(filled, tiny_table)


@pytest.mark.parametrize("damage", ["cut short", "of something else", "of another shape"])
def test_a_damaged_cell_is_computed_again(every, filled, tmp_path, damage):
    copy(filled, tmp_path, [every[0].file])
    path = tmp_path / CELLS / every[0].file
    document = json.loads(path.read_text(encoding="utf-8"))
    if damage == "of something else":
        document["made_by"]["seed"] = 4
    document["values"]["trace"] = document["values"]["trace"][: 1 if damage == "of another shape" else None]
    text = json.dumps(document)
    path.write_text(text[: len(text) // 2] if damage == "cut short" else text, encoding="utf-8")
    assert every[0].load(tmp_path) is None
    assert fill(every[:1], tmp_path) == 1 and every[0].load(tmp_path) is not None


def test_several_processes_make_what_one_makes(every, filled, tiny_table, tmp_path):
    for process in range(3):
        fill(share(every, process, 3), tmp_path)
    assert fill(every, tmp_path) == 0
    assert numbers(tmp_path, tiny_table) == numbers(filled, tiny_table)


def test_rows_that_lack_a_cell_are_left_out(every, filled, tiny_table, tmp_path):
    copy(filled, tmp_path, [one.file for one in every[:5]])  # random and greedy of the first part, one of lawnmower
    assert list(numbers(tmp_path, tiny_table)) == [(0, row, b) for row in ROWS[:2] for b in (2.0, 3.0)]
    assert len(read(tiny_table, tmp_path, SAMPLE).made) == 4


@given(st.integers(0, 60), st.integers(1, 9))
def test_shares_cover_every_cell_once_and_evenly(count, processes):
    every = [Cell(Row("one", "random"), Scenario(), 1, 1, seed, shape_of(Scenario())) for seed in range(count)]
    shares = [share(every, process, processes) for process in range(processes)]
    assert sorted(one.seed for mine in shares for one in mine) == list(range(count))
    assert max(map(len, shares)) - min(map(len, shares)) <= 2


@pytest.mark.parametrize("process", [-1, 2])
def test_a_process_that_is_none_of_them_is_refused(process):
    with pytest.raises(InputError, match=f"--process-id: {process} is none of 2; give 0 to 1"):
        share([], process, 2)


def test_a_folder_that_cannot_be_made_is_told(every, tmp_path, filled):
    (tmp_path / "file").write_text("", encoding="utf-8")
    result = every[0].load(filled)
    with pytest.raises(InputError, match="cannot be made"):
        every[0].save(result, tmp_path / "file")


def test_a_cell_that_is_not_a_number_is_neither_written_nor_read(every, filled, tmp_path):
    cell = every[0]
    result = cell.load(filled)
    values = {metric: rows.copy() for metric, rows in result.values.items()}
    values["true_trace"][1, 0] = np.nan
    with pytest.raises(InputError, match="^instance 1, trial 0: true_trace is nan"):
        cell.save(dataclasses.replace(result, values=values), tmp_path)
    assert not list(tmp_path.rglob("*.json"))
    copy(filled, tmp_path, [cell.file])
    path = tmp_path / CELLS / cell.file
    document = json.loads(path.read_text(encoding="utf-8"))
    document["values"]["true_trace"][1][0] = float("nan")
    path.write_text(json.dumps(document), encoding="utf-8")
    assert cell.load(tmp_path) is None
