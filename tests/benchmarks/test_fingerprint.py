"""A fingerprint changes with what decides the numbers, and with nothing else."""

import dataclasses
import json

import equinox as eqx
import jax
import pytest

from maipp.benchmarks import fingerprint
from maipp.benchmarks.cells import Cell
from maipp.benchmarks.fingerprint import code_digest, planner_fingerprint, weights_digest
from maipp.benchmarks.table_rows import Row
from maipp.planners import make_planner
from maipp.problem import shape_of
from maipp.scenario import Scenario

CELL = Cell(
    Row("one", "greedy"), Scenario(budget=2.0), instances=3, trials=2, seed=0, shape=shape_of(Scenario(budget=2.0))
)


@pytest.mark.parametrize(
    "change",
    [
        {"scenario": Scenario(budget=2.0, comm_range=0.3)},
        {"row": Row("one", "greedy", {"shared": True})},
        {"row": Row("one", "random")},
        {"instances": 4},
        {"trials": 3},
        {"seed": 1},
    ],
)
def test_what_decides_the_numbers_changes_the_file(change):
    other = dataclasses.replace(CELL, **change)
    assert other.made_by != CELL.made_by and other.file != CELL.file


def test_the_shape_it_is_compiled_in_decides_nothing():
    other = dataclasses.replace(CELL, shape=shape_of(Scenario(budget=3.0)))
    assert other.made_by == CELL.made_by and other.file == CELL.file


def test_options_spelled_out_or_left_at_their_defaults_are_the_same():
    assert dataclasses.replace(CELL, row=Row("one", "greedy", {"shared": "false"})).file == CELL.file


def test_it_is_plain_json_and_names_the_versions():
    assert json.loads(json.dumps(CELL.made_by)) == CELL.made_by
    assert {"maipp", "jax", "python"} <= CELL.made_by["versions"].keys()
    assert CELL.made_by["weights"] == "" and CELL.made_by["file"] == ""


def test_weights_are_told_by_their_numbers():
    untrained = make_planner("ti", Scenario(), {"weights": "untrained"})
    moved = eqx.tree_at(lambda planner: jax.tree.leaves(planner)[0], untrained, replace_fn=lambda leaf: leaf + 1)
    assert weights_digest(untrained) == weights_digest(make_planner("ti", Scenario(), {"weights": "untrained"}))
    assert weights_digest(untrained) != weights_digest(moved)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Modules of maipp that can be changed."""
    files = {"maipp.a": "from maipp.b import f\n", "maipp.b": "def f():\n    'Words.'\n    return 1\n"}
    for name, text in files.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")

    def source(name):
        path = tmp_path / f"{name}.py"
        return path if path.exists() else None

    monkeypatch.setattr(fingerprint, "_source", source)
    return tmp_path


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("def f():\n    return 1  # why\n", True),
        ("def f():\n    'Other words.'\n\n    return 1\n", True),
        ("def f():\n    return 2\n", False),
    ],
)
def test_code_counts_through_imports_but_not_comments_and_docstrings(package, text, same):
    before = code_digest.__wrapped__(("maipp.a",))
    (package / "maipp.b.py").write_text(text, encoding="utf-8")
    assert (code_digest.__wrapped__(("maipp.a",)) == before) is same


def test_what_the_package_re_exports_does_not_count(package):
    (package / "maipp.py").write_text("from maipp.c import g\n", encoding="utf-8")
    (package / "maipp.c.py").write_text("def g():\n    return 1\n", encoding="utf-8")
    (package / "maipp.a.py").write_text("from maipp import b\n", encoding="utf-8")
    before = code_digest.__wrapped__(("maipp.a",))
    (package / "maipp.c.py").write_text("def g():\n    return 2\n", encoding="utf-8")
    assert code_digest.__wrapped__(("maipp.a",)) == before
    (package / "maipp.b.py").write_text("def f():\n    return 2\n", encoding="utf-8")
    assert code_digest.__wrapped__(("maipp.a",)) != before


def test_the_engine_and_the_planner_count_and_other_planners_do_not():
    digests = {name: planner_fingerprint(make_planner(name, Scenario()))["code"] for name in ("greedy", "random")}
    assert digests["greedy"] != digests["random"]
    assert code_digest(("maipp.engine.rollout",)) != code_digest(("maipp.engine.rollout", "maipp.planners.greedy"))
