"""The log and the learning curve that is drawn from it."""

import json

import numpy as np
import pytest

from maipp.training.curves import _pooled, draw_learning_curve
from maipp.training.training_log import TrainingLog, read_log


def update(number, trace: float | None = 10.0, ended=2):
    return {"update": number, "transitions": 8 * number, "wall_s": 3.0 * number, "loss": 0.5} | {
        "final_trace": trace,
        "missions_ended": ended,
    }


def evaluation(number, trace: float | None = 8.0, se: float | None = 1.0):
    return update(number) | {"evaluation": {"trace": trace, "se": se}}


def journal(out, rows, **after):
    log = TrainingLog(out, **({"updates": 0, "evaluated": -1} | after))
    for row in rows:
        log.write(row)
    log.close()


def test_lines_beyond_the_checkpoint_are_dropped(tmp_path):
    journal(tmp_path, [evaluation(0), update(1), update(2), evaluation(2), update(3)])
    with open(tmp_path / "log.jsonl", "a") as file:
        file.write('{"update": 4, "transit')  # where the kill came
    assert [row["update"] for row in read_log(tmp_path)] == [0, 1, 2, 2, 3]
    journal(tmp_path, [update(3, trace=7.0)], updates=2, evaluated=0)
    rows = read_log(tmp_path)
    assert [(row["update"], "evaluation" in row) for row in rows] == [(0, True), (1, False), (2, False), (3, False)]
    assert rows[-1]["final_trace"] == 7.0


def test_a_line_is_there_as_soon_as_it_is_written(tmp_path):
    log = TrainingLog(tmp_path, updates=0, evaluated=-1)
    log.write(update(1))
    assert read_log(tmp_path) == [update(1)]
    log.close()


def test_numbers_that_json_lacks_become_null(tmp_path):
    journal(tmp_path, [update(1, trace=float("nan")), evaluation(1, trace=float("inf"))])
    text = (tmp_path / "log.jsonl").read_text()
    assert "NaN" not in text and "Infinity" not in text
    first, second = map(json.loads, text.splitlines())
    assert first["final_trace"] is None and second["evaluation"]["trace"] is None


def test_the_curve_pools_updates_by_the_missions_that_ended(tmp_path):
    rows = [update(1, 30.0, 1), update(2, 10.0, 3), update(3, None, 0), update(4, 5.0, 4)]
    x, trace = _pooled(rows, "transitions")
    assert (x == [8, 16, 32]).all() and (trace == [30, 10, 5]).all()
    many = [update(n, float(n % 2), 1 + 2 * (n % 2)) for n in range(1, 241)]  # 60 groups of four
    x, trace = _pooled(many, "wall_s")
    np.testing.assert_allclose(trace, np.full(60, 0.75))
    assert x[-1] == 720.0 and x[0] == 12.0


@pytest.mark.parametrize(
    "rows",
    [[], [evaluation(0, se=None)], [update(1, None, 0)], [evaluation(0), update(1), update(2, 5.0), evaluation(2)]],
)
def test_a_curve_is_drawn_of_whatever_there_is(tmp_path, rows):
    journal(tmp_path, rows)
    draw_learning_curve(tmp_path, "a run")
    assert (tmp_path / "learning_curve.png").read_bytes().startswith(b"\x89PNG")
