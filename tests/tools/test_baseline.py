"""The baseline compares multiples of a kernel, so that a machine twice as fast changes nothing."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from tests.tools.baseline import BASELINE, compare, kernel_seconds, load_baseline, save_baseline, slower
from tests.tools.bench import PLANNERS, Timing

FOUND = {"greedy": {"decision": 2.0, "episode": 30.0}}


@pytest.fixture
def kept(tmp_path):
    save_baseline(FOUND, tmp_path / "baseline.json")
    return load_baseline(tmp_path / "baseline.json")


@given(st.floats(0.01, 100.0))
def test_the_speed_of_the_machine_cancels(speed):
    timing = Timing("greedy", *(number * speed for number in (2.0, 3.0, 30.0, 500.0, 6.0)))
    multiples = timing.multiples(0.001 * speed)
    assert multiples == pytest.approx({"decision": 2.0, "episode": 30.0, "batched decision": 0.5})
    rows = compare({"greedy": multiples}, {"multiples": {"greedy": {"decision": 2.0, "episode": 30.0}}})
    assert [row.change for row in rows[:2]] == pytest.approx([1.0, 1.0]) and slower(rows, 1.01) == []


def test_what_grew_is_told(kept):
    rows = compare({"greedy": {"decision": 3.0}, "random": {"decision": 1000.0}}, kept)
    assert [(row.planner, row.change) for row in rows] == [("greedy", pytest.approx(1.5)), ("random", None)]
    assert [row.planner for row in slower(rows, 1.25)] == ["greedy"]
    assert slower(rows, 1.6) == []


def test_an_update_keeps_what_was_not_timed(tmp_path, kept):
    path = tmp_path / "baseline.json"
    save_baseline({"greedy": {"decision": 4.00004}, "random": {"decision": 1.0}}, path)
    assert load_baseline(path)["multiples"] == {
        "greedy": {"decision": 4.0, "episode": 30.0},
        "random": {"decision": 1.0},
    }


def test_no_file_is_an_empty_baseline_and_another_file_none(tmp_path):
    assert load_baseline(tmp_path / "none.json")["multiples"] == {}
    for text, problem in (("{", "cannot be read"), ("[]", "not a baseline")):
        (tmp_path / "other.json").write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=problem):
            load_baseline(tmp_path / "other.json")


def test_the_kernel_takes_time():
    assert kernel_seconds(repeat=1) > 0


def test_the_one_in_the_repository_has_every_planner_that_is_timed():
    multiples = json.loads(BASELINE.read_text(encoding="utf-8"))["multiples"]
    assert set(PLANNERS) <= set(multiples)
    assert all(set(paths) == {"decision", "episode", "batched decision"} for paths in multiples.values())
