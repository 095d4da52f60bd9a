"""Latency: pinned while timing alone, written after every row."""

import json
import os

import pytest

from maipp.bench.latency import Latency, LatencyPlan, latency_table, one_core, typed, write_latency
from maipp.bench.tables import Row
from maipp.scenario import Scenario

PLAN = LatencyPlan(
    Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4),
    (Row("random", "random"), Row("sweep", "lawnmower")),
    decisions=3,
    batch=3,
)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system cannot pin a process")
def test_one_core_is_used_inside_and_all_afterwards():
    before = os.sched_getaffinity(0)
    with one_core():
        assert os.sched_getaffinity(0) == {min(before)}
    assert os.sched_getaffinity(0) == before


def test_every_row_is_timed_and_written(tmp_path):
    told = []
    paths = write_latency(PLAN, tmp_path / "run", told.append)
    assert [path.name for path in paths] == ["latency.json", "latency.md"] and len(told) == 2
    document = json.loads(paths[0].read_text(encoding="utf-8"))
    assert [row["row"] for row in document["rows"]] == ["random", "sweep"]
    for row in document["rows"]:
        assert 0 < row["median_ms"] <= row["p95_ms"] <= row["p99_ms"]
        assert row["decisions"] >= 3 and row["per_second"] > 0 and row["compile_s"] >= 0
    assert Scenario.from_dict(document["scenario"]) == PLAN.scenario
    assert "| `sweep` |" in paths[1].read_text(encoding="utf-8")


def test_an_interrupt_keeps_the_rows_that_are_done(tmp_path):
    def interrupted(words):
        if "sweep" in words:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_latency(PLAN, tmp_path, interrupted)
    assert [row["row"] for row in json.loads((tmp_path / "latency.json").read_text())["rows"]] == ["random"]


def test_the_table_has_three_digits():
    row = Latency("random", 0.012345, 1.5, 20.0, 300, 2.0, 64, 3.21, 12345.6, 2)
    assert latency_table([row]).splitlines()[-1] == "| `random` | 0.0123 | 1.50 | 20.0 | 2.00 | 12,346 | 3.21 |"


def test_the_command_says_what_differs():
    assert typed(LatencyPlan(), LatencyPlan().rows, "run") == "maipp benchmark latency --out run"
    assert typed(PLAN, PLAN.rows[:1], "run") == (
        "maipp benchmark latency --out run --decisions 3 --batch 3 --agents 2 --budget 0.6 --planners random"
    )
