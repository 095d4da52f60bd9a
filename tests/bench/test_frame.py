"""The frame: a line for each mission with what it was, whose CSV gives every number again."""

import dataclasses
import io
import math

import numpy as np
import pandas as pd
import pytest

from maipp.bench.cells import CellResult
from maipp.bench.evaluate import Evaluation
from maipp.bench.frame import evaluated, grids, metrics_of, missions, results_of, wide
from maipp.bench.tables import TABLES
from maipp.bench.tidy_csv import csv_text, missions_csv
from maipp.scenario import Scenario

ABOUT = ["table", "row", "planner", "options", "agents", "budget", "range", "length_scale"]


def made_up(instances=3, trials=2, precision="float32", shift=0.0):
    values = shift + np.exp(np.arange(instances * trials)).reshape(instances, trials)
    exact = values.astype(precision).astype(np.float64)
    machine = {"devices": 2, "precision": precision}
    return CellResult({"trace": exact, "rmse": exact / 4}, 1.5, machine, {"python": "3.11"})


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_a_line_for_each_mission_that_csv_gives_again(precision):
    table, result = TABLES["table4"], made_up(precision=precision)
    parts = {part: missions(table, part, table.rows[0], 3.0, result) for part in (0, 2)}
    assert list(parts[0].columns) == [*ABOUT, "instance", "trial", "trace", "rmse"]
    results = results_of([*parts.values()], [result, result])
    assert results.seconds == 6.0 and len(results.made) == 2 and len(results.missions) == 12
    first = dict(results.missions.iloc[0])
    assert first | {"trace": 0, "rmse": 0} == {
        "table": "table4", "row": "sga-rrt-0.3", "planner": "sga-rrt", "options": "lengths=0.3,0.4", "agents": 3,
        "budget": 3.0, "range": 0.3, "length_scale": 0.45, "instance": 0, "trial": 0, "trace": 0, "rmse": 0,
    }  # fmt: skip
    again = pd.read_csv(io.StringIO(missions_csv(results.missions)))
    assert list(again["range"].isna()) == [False] * 6 + [True] * 6
    for metric in metrics_of(results.missions):
        np.testing.assert_array_equal(again[metric].astype(precision), results.missions[metric])


def test_a_table_s_own_key_is_a_column():
    table = dataclasses.replace(TABLES["table1"], column="noise", columns=(0.01, 0.02))
    frame = missions(table, 0, table.rows[0], 0.02, made_up())
    assert list(frame.columns) == [*ABOUT, "noise", "instance", "trial", "trace", "rmse"]
    assert set(frame["noise"]) == {0.02} and [*frame.index.unique()] == [(0, 0.02)]
    frame = missions(dataclasses.replace(table, column="comm_range"), 0, table.rows[0], 0.4, made_up())
    assert set(frame["range"]) == {0.4} and "comm_range" not in frame


def test_groups_come_in_the_order_of_the_frame_whatever_the_order_of_the_missions():
    table = TABLES["table1"]
    rows, columns = table.rows[:2][::-1], (5.0, 2.0)
    found = {(row.name, b): made_up(shift=10 * i + b) for i, row in enumerate(rows) for b in columns}
    cells = [missions(table, 0, row, b, found[row.name, b]) for row in rows for b in columns]
    shuffled = pd.concat([cell.sample(frac=1.0, random_state=1) for cell in cells])
    values = grids(shuffled, "trace")
    assert list(values) == list(found)
    for cell, result in found.items():
        np.testing.assert_array_equal(values[cell], np.float32(result.values["trace"]))
    page = wide({cell: f"{cell[1]:g}" for cell in [*values][:3]})
    assert page.index.tolist() == [row.name for row in rows] and page.columns.tolist() == [5.0, 2.0]
    assert page.to_numpy().tolist() == [["5", "2"], ["5", ""]]


def test_evaluations_have_the_same_frame():
    def evaluation(first, values):
        result = made_up()
        scenario = Scenario(agents=2, budget=(1.0, 2.0), comm_range=0.3)
        return Evaluation(
            scenario, "greedy", {"shared": True, "at": (1, 2)}, 3, first, 2, 7, values(result.values), 8, None, 1.5,
            result.machine, result.versions, "",
        )  # fmt: skip

    frame = evaluated([evaluation(0, dict), evaluation(3, lambda values: values | {"fitted_rmse": values["rmse"]})])
    assert list(frame.columns) == [
        *ABOUT[2:], "seed", "instance", "trial", "trace", "rmse", "fitted_rmse",
    ]  # fmt: skip
    assert list(frame["instance"].unique()) == [0, 1, 2, 3, 4, 5] and set(frame["seed"]) == {7}
    lines = missions_csv(frame).splitlines()
    assert lines[1].startswith('greedy,"shared=true at=1,2",2,2,0.3,0.45,7,0,0,1,0.25,') and lines[1].endswith(",")
    assert lines[7].startswith('greedy,"shared=true at=1,2",2,2,0.3,0.45,7,3,0,1,0.25,0.25')


def test_no_digit_is_lost_where_parts_come_from_several_machines():
    result = made_up(precision="float64")
    machine = {"several": [{"precision": "float32"}, result.machine]}
    scenario, values = Scenario(budget=1.0), dict(result.values)
    merged = Evaluation(scenario, "greedy", {}, 3, 0, 2, 7, values, 8, None, 1.5, machine, {}, "")
    np.testing.assert_array_equal(evaluated([merged])["trace"], result.values["trace"].reshape(-1))


def test_numbers_have_the_fewest_digits_of_their_precision():
    frame = pd.DataFrame({"a": np.array([0.1, 3.0], np.float32), "b": [0.1, math.nan], "c": ["x,y", ""], "d": [1, 2]})
    assert csv_text(frame) == 'a,b,c,d\n0.1,0.1,"x,y",1\n3.0,nan,,2\n'
