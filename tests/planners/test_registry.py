"""Planners by name, and their options from text."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.cli.main import main
from maipp.errors import InputError
from maipp.planners import (
    make_planner,
    planner_class,
    planner_names,
    planner_note,
    planner_options,
    planner_summary,
    register,
    registry,
)
from maipp.planners.options import values_of
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)

# What the registry does needs no trained weights.
UNTRAINED = {"weights": "untrained"}

PLANNER = '''
from __future__ import annotations
import equinox as eqx
from typing import Literal
from maipp.errors import InputError
from maipp.engine import Planner

class Still(Planner):
    """Stays where it is.

    And more."""

    size: float = eqx.field(static=True, default=0.5)
    times: tuple[int, ...] = eqx.field(static=True, default=())
    pair: tuple[float, float] = eqx.field(static=True, default=(0.0, 1.0))
    loud: bool = eqx.field(static=True, default=False)
    rows: int | None = eqx.field(static=True, default=None)
    mode: Literal["slow", "fast"] = eqx.field(static=True, default="slow")
    label: str = eqx.field(static=True, default="")

    def check(self) -> None:
        if not self.size > 0:
            raise InputError(f"size: {self.size} is not a size; give a number > 0")

class NotOne:
    pass
'''

# Options may have any name; what holds arrays, and what is hidden, is none.
NAMES = """
import equinox as eqx
import jax.numpy as jnp
from maipp.engine import Planner, option, part
from maipp.planners.search import PlanSearch

class Named(Planner):
    sweep: int = option(3, meaning="rows swept")
    network: str = option("wifi")
    zones: int = option(meaning="how many")
    waypoints_per_decision: int = option(2)
    weights: jnp.ndarray = eqx.field(default_factory=lambda: jnp.arange(3.0), kw_only=True)
    offset: jnp.ndarray | None = None
    secret: int = eqx.field(static=True, default=7, metadata={"option": False})
    derived: int = eqx.field(static=True, init=False, default=1)

class Composed(Planner):
    search: PlanSearch = part(PlanSearch, horizon=3)
    sweep: int = option(1)

class Bare(Planner):
    table: jnp.ndarray
    size: int = option(1)
"""


@pytest.fixture
def still(tmp_path: Path) -> str:
    (tmp_path / "still.py").write_text(PLANNER, encoding="utf-8")
    return f"{tmp_path / 'still.py'}:Still"


@pytest.fixture
def names(tmp_path: Path) -> str:
    (tmp_path / "names.py").write_text(NAMES, encoding="utf-8")
    return f"{tmp_path / 'names.py'}:"


@pytest.fixture
def clean_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_REGISTERED", dict(registry._REGISTERED))


def test_the_registry_imports_no_jax():
    code = "import sys, maipp.planners; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", planner_names())
def test_every_name_leads_to_a_planner_with_options_that_it_accepts(name):
    defaults = {option.name: option.default for option in planner_options(name)}
    untrained = UNTRAINED if "weights" in defaults else {}
    planner = make_planner(name, SCENARIO, untrained)
    assert planner.scenario == SCENARIO
    assert planner_summary(name)
    assert make_planner(name, SCENARIO, defaults | untrained) == planner


@pytest.mark.parametrize("name", planner_names())
def test_every_option_can_be_typed(name):
    options = planner_options(name)
    untrained = {option.name: UNTRAINED[option.name] for option in options if option.name in UNTRAINED}
    for option in options:
        value = untrained.get(option.name, option.default)
        text = ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
        assert values_of(make_planner(name, SCENARIO, untrained | {option.name: text}))[option.name] == value


def test_a_name_may_preset_options():
    assert make_planner("shared-greedy", SCENARIO).shared is True  # type: ignore[attr-defined]
    assert make_planner("greedy", SCENARIO).shared is False  # type: ignore[attr-defined]


def test_the_paper_s_three_intent_planners_are_one_class_with_presets():
    names = ("intent", "choose", "paths", "steps")
    given = {
        name: tuple({option.name: option.default for option in planner_options(name)}[key] for key in names)
        for name in ("di", "ti", "intent-paths")
    }
    assert given == {
        "di": ("destination", "likeliest", 8, 3),
        "ti": ("trajectory", "likeliest", 8, 5),
        "intent-paths": ("trajectory", "best", 8, 5),
    }
    assert {option.name for option in planner_options("ti")}.isdisjoint({"network", "scenario"})


@pytest.mark.parametrize(
    ("option", "text", "value"),
    [
        ("size", "2", 2.0),
        ("size", 2, 2.0),
        ("times", "3, 4,5", (3, 4, 5)),
        ("times", "", ()),
        ("times", [3], (3,)),
        ("pair", "(0.3,0.4)", (0.3, 0.4)),
        ("loud", "true", True),
        ("loud", "No", False),
        ("rows", "7", 7),
        ("rows", "none", None),
        ("mode", "fast", "fast"),
        ("label", "none", "none"),
    ],
)
def test_options_are_read_by_their_annotation(still, option, text, value):
    got = getattr(make_planner(still, SCENARIO, {option: text}), option)
    assert got == value and type(got) is type(value)


@pytest.mark.parametrize(
    ("option", "text", "right"),
    [
        ("size", "big", "is not a number"),
        ("size", "nan", "is not a number"),
        ("size", True, "is not a number"),
        ("size", "-1", "give a number > 0"),
        ("times", "1,x", "give a list such as 3,4"),
        ("pair", "0.3", "is not 2 values such as 0.3,0.4"),
        ("pair", 0.3, "is not 2 values such as 0.3,0.4"),
        ("loud", "maybe", "is not true or false"),
        ("rows", "1.5", "is not a whole number or none"),
        ("mode", "warp", "is not one of slow, fast"),
        ("sise", "1", "did you mean size?"),
        ("scenario", "1", "there are size, times, pair"),
    ],
)
def test_a_bad_option_says_on_one_line_what_would_be_right(still, option, text, right):
    with pytest.raises(InputError) as error:
        make_planner(still, SCENARIO, {option: text})
    assert right in str(error.value) and option in str(error.value) and "\n" not in str(error.value)


def test_an_option_may_have_any_name(names):
    planner = make_planner(names + "Named", SCENARIO, {"sweep": "5", "network": "lora", "zones": "2"})
    assert (planner.sweep, planner.network, planner.zones) == (5, "lora", 2)  # type: ignore[attr-defined]
    assert planner.waypoints_per_decision == 2


def test_arrays_and_hidden_fields_are_no_options(names):
    described = [(option.name, option.meaning) for option in planner_options(names + "Named")]
    assert described == [
        ("sweep", "rows swept"),
        ("network", ""),
        ("zones", "how many"),
        ("waypoints_per_decision", ""),
    ]
    for name in ("weights", "offset", "secret", "derived", "scenario"):
        with pytest.raises(InputError, match=f"no option '{name}'"):
            make_planner(names + "Named", SCENARIO, {"zones": "1", name: "1"})


def test_a_part_s_options_are_the_planner_s(names):
    composed = names + "Composed"
    defaults = {option.name: option.default for option in planner_options(composed)}
    assert (*defaults.items(),)[0] == ("horizon", 3) and defaults["sweep"] == 1 and "zones" not in defaults
    planner: Any = make_planner(composed, SCENARIO, {"sweep": "5", "elites": "4"})
    assert (planner.sweep, planner.search.horizon, planner.search.elites) == (5, 3, 4)
    assert values_of(planner) == defaults | {"sweep": 5, "elites": 4}
    with pytest.raises(InputError, match="elites=999 is more than candidates"):
        make_planner(composed, SCENARIO, {"elites": 999})
    assert planner_class(composed)(SCENARIO).parts[0].horizon == 3  # type: ignore[attr-defined]


def test_an_option_without_a_default_must_be_given(names):
    with pytest.raises(InputError, match="zones: has no default; give a whole number"):
        make_planner(names + "Named", SCENARIO)


def test_a_field_that_is_no_option_and_has_no_default_is_told(names):
    with pytest.raises(InputError, match="'table'; give the field a default, or make it an option"):
        make_planner(names + "Bare", SCENARIO)


def test_every_option_says_what_it_means():
    for name in planner_names():
        for option in planner_options(name):
            assert option.meaning, f"{name}: {option.name}"


@given(st.text())
def test_any_text_is_read_or_refused(text):
    for option in ("lengths", "nodes", "branch", text):
        try:
            make_planner("sga-rrt", SCENARIO, {option: text})
        except InputError as error:
            assert str(error)


def test_an_unknown_planner_is_told_the_nearest():
    with pytest.raises(InputError, match=r"no planner 'sga-rtt' \(did you mean sga-rrt\?\); there are random, greedy"):
        make_planner("sga-rtt", SCENARIO)


@pytest.mark.parametrize(
    ("target", "problem"),
    [
        ("nowhere.py:Planner", "no file nowhere.py"),
        ("maipp.nowhere:Planner", "No module named 'maipp.nowhere'"),
        ("maipp.planners.greedy:Greedi", r"did you mean Greedy\?"),
        (":Greedy", "no module before the colon"),
        ("maipp.scenario:Scenario", "it is no planner"),
    ],
)
def test_a_target_that_leads_nowhere_is_told_so(target, problem):
    with pytest.raises(InputError, match=problem):
        make_planner(target, SCENARIO)


def test_a_class_that_is_no_planner_is_refused(still):
    with pytest.raises(InputError, match="it is no planner"):
        make_planner(still.replace("Still", "NotOne"), SCENARIO)


@pytest.mark.parametrize(("code", "line"), [("x = 1\n1 / 0\n", 2), ("def f(:\n", 1)])
def test_a_file_that_fails_names_the_line(tmp_path, code, line):
    (tmp_path / "bad.py").write_text(code, encoding="utf-8")
    with pytest.raises(InputError, match=rf"bad\.py:{line}: \w+Error: ") as error:
        make_planner(f"{tmp_path / 'bad.py'}:Bad", SCENARIO)
    assert "\n" not in str(error.value)


def test_a_file_is_run_once_so_that_its_class_is_compiled_once(still):
    assert type(make_planner(still, SCENARIO)) is type(make_planner(still, SCENARIO))


def test_a_planner_of_ones_own_can_have_a_name(still, clean_registry):
    register("big-still", still, size=9.0)
    assert make_planner("big-still", SCENARIO).size == 9.0  # type: ignore[attr-defined]
    assert make_planner("big-still", SCENARIO, {"size": "3"}).size == 3.0  # type: ignore[attr-defined]
    assert planner_summary("big-still") == "Stays where it is."
    assert {option.name: option.default for option in planner_options("big-still")}["size"] == 9.0


def test_a_class_can_be_registered_itself(still, clean_registry):
    register("still", type(make_planner(still, SCENARIO)), summary="stays")
    assert make_planner("still", SCENARIO) == make_planner(still, SCENARIO)


@pytest.mark.parametrize("name", ["", "a b", "a:b"])
def test_a_name_that_looks_like_a_target_is_refused(name, clean_registry):
    with pytest.raises(InputError, match="give a word"):
        register(name, "maipp.planners.greedy:Greedy")


def test_ti_star_is_the_paper_s_and_old_options_say_so_too(capsys):
    """And the name says that its meaning has changed."""
    old = {"rank": "stationary", "share": "samples", "distinct": False, "keep": False, "meet": False, "recall": False}
    paper, ours = (
        make_planner(name, Scenario(), {"weights": "untrained"} | old) for name in ("ti-star", "intent-paths")
    )
    default = make_planner("ti-star", Scenario(), {"weights": "untrained"})
    assert values_of(paper) == values_of(ours) == values_of(default)
    assert main(["evaluate", "--planner", "ti-star", "--set", "paths=0"]) == 2
    note, error = capsys.readouterr().err.splitlines()
    assert note == f"note: {planner_note('ti-star')}" and "intent-paths" in note and error.startswith("error: ")
