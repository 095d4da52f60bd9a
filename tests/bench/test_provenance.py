"""A fingerprint changes with what decides the numbers, and with nothing else; the machine is recorded beside it."""

import dataclasses
import importlib.metadata
import json
import sys

import equinox as eqx
import jax
import pytest

from maipp.bench.cells import Cell
from maipp.bench.provenance import (
    code_digest,
    cpu_model,
    machine,
    planner_fingerprint,
    user_code,
    versions,
    weights_digest,
)
from maipp.bench.tables import Row
from maipp.devices import core_count
from maipp.errors import InputError
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
    known = CELL.made_by["versions"]
    assert {"python", "maipp", "jax", "jaxlib", "numpy", "scipy", "shapely", "optax"} <= known.keys()
    assert known.keys().isdisjoint({"rich", "matplotlib", "pytest"})
    assert CELL.made_by["weights"] == "" and CELL.made_by["file"] == ""


def test_weights_are_told_by_their_numbers():
    untrained = make_planner("ti", Scenario(), {"weights": "untrained"})
    moved = eqx.tree_at(
        lambda planner: jax.tree.leaves(planner.sampler.network)[0], untrained, replace_fn=lambda leaf: leaf + 1
    )
    assert weights_digest(untrained) == weights_digest(make_planner("ti", Scenario(), {"weights": "untrained"}))
    assert weights_digest(untrained) != weights_digest(moved)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Modules of maipp that can be changed."""
    files = {"maipp.a": "from maipp.b import f\n", "maipp.b": "def f():\n    'Words.'\n    return 1\n"}
    for name, text in files.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")

    def file(name):
        path = tmp_path / f"{name}.py"
        return path if path.exists() else None

    monkeypatch.setattr(provenance, "module_file", file)
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


def test_every_library_that_numbers_come_from_counts(monkeypatch):
    before, version = planner_fingerprint(make_planner("random", Scenario())), importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "9" if name == "shapely" else version(name))
    after = planner_fingerprint(make_planner("random", Scenario()))
    assert after != before and after["versions"]["shapely"] == "9"


# Planners of one's own.

PLANNER = """
import {tag}helper
from maipp.engine import Decision, Planner
{line}
class Own(Planner):
    def decide(self, key, observation, memory):
        import {tag}lazy.inner
        return Decision(observation.position[None], (), memory)
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A planner in a file, with helpers beside it; gives its fingerprint."""
    tag = f"{tmp_path.name}_".replace("-", "_")  # modules are imported once in a process
    monkeypatch.syspath_prepend(str(tmp_path))
    files = {"planner.py": PLANNER.format(tag=tag, line=""), f"{tag}helper.py": f"from {tag}deeper import f\n"}
    files |= {f"{tag}deeper.py": "def f():\n    return 1\n", f"{tag}other.py": "x = 1\n"}
    files |= {f"{tag}lazy/__init__.py": "x = 1\n", f"{tag}lazy/inner.py": "from . import beside\n"}
    files |= {f"{tag}lazy/beside.py": "from ..none import x\n", f"{tag}lazy/apart.py": "x = 1\n"}

    def write(name, text):
        path = tmp_path / name.replace("TAG", tag)
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")

    for name, text in files.items():
        write(name, text)
    planner = make_planner(f"{tmp_path / 'planner.py'}:Own", Scenario())
    write.fingerprint = lambda: planner_fingerprint(planner)
    write.planner = lambda line: write("planner.py", PLANNER.format(tag=tag, line=line))
    return write


@pytest.mark.parametrize(
    ("name", "text", "counts"),
    [
        ("TAGdeeper.py", "def f():\n    return 2\n", True),
        ("TAGdeeper.py", "def f():\n    'Words.'\n    return 1  # why\n", False),
        ("TAGlazy/__init__.py", "x = 2\n", True),
        ("TAGlazy/inner.py", "from . import apart\n", True),
        ("TAGlazy/beside.py", "x = 2\n", True),
        ("TAGlazy/apart.py", "x = 2\n", False),
        ("TAGother.py", "x = 2\n", False),
    ],
)
def test_what_a_planner_of_ones_own_imports_counts(own, name, text, counts):
    before = own.fingerprint()
    own(name, text)
    after = own.fingerprint()
    assert (after["file"] != before["file"]) is counts and after | {"file": ""} == before | {"file": ""}


def test_what_it_imports_of_maipp_and_of_libraries_counts(own):
    before = own.fingerprint()
    own.planner("from maipp.planners.lookahead import predicted_trace")
    assert own.fingerprint()["code"] != before["code"]
    own.planner("import hypothesis.strategies, json")
    after = own.fingerprint()["versions"]
    assert after == before["versions"] | {"hypothesis": importlib.metadata.version("hypothesis")}


def test_a_package_counts_with_its_bases_and_what_they_import(tmp_path, monkeypatch):
    files = {
        "__init__": "",
        "tools": "x = 1\n",
        "base": "from maipp.engine import Planner\nfrom .tools import x\nclass Base(Planner):\n    pass\n",
        "sub.__init__": "",
        "sub.mine": "from ..base import Base\nclass Mine(Base):\n    pass\n",
    }
    for name, text in files.items():
        path = tmp_path / "surveyors" / f"{name.replace('.', '/')}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    # As where the package is installed.
    monkeypatch.setattr(provenance, "_installed", lambda: {"surveyors": ["surveyors"], "equinox": ["equinox"]})
    planner = make_planner("surveyors.sub.mine:Mine", Scenario())
    found = user_code(type(planner))
    assert set(found.own) == {f"surveyors{name}" for name in ("", ".sub", ".sub.mine", ".base", ".tools")}
    before = planner_fingerprint(planner)
    (tmp_path / "surveyors" / "tools.py").write_text("x = 2\n", encoding="utf-8")
    assert planner_fingerprint(planner) != before
    for name in [name for name in sys.modules if name.startswith("surveyors")]:
        del sys.modules[name]


def test_code_without_a_file_is_refused():
    namespace = {"__name__": "nowhere"}
    exec("from maipp.engine import Planner\nclass Typed(Planner):\n    pass\n", namespace)
    with pytest.raises(InputError, match="Typed: its code has no file"):
        planner_fingerprint(namespace["Typed"](Scenario()))  # type: ignore[operator]


def test_versions_are_those_installed():
    found = versions()
    assert found["jax"] == importlib.metadata.version("jax") and found["numpy"] == importlib.metadata.version("numpy")
    assert found["python"].startswith("3.") and "maipp" in found


def test_the_machine_is_described():
    found = machine()
    assert found["cores"] == core_count() >= 1
    assert found["cpu"] == cpu_model() != ""
    assert found["precision"] in ("float32", "float64") and found["devices"] >= 1
