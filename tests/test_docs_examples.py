"""The examples in docs/ run, and the page shows the code that runs."""

import importlib.util
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

import maipp
from maipp.cli.main import main
from maipp.planners import registry

DOCS = Path(__file__).parents[1] / "docs"
MY_PLANNER = f"{DOCS / 'examples' / 'my_planner.py'}:BestHeading"
SCENARIO = maipp.Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)
TINY = "--agents 2 --budget 0.6 --set scenario.grid=8 --instances 2 --trials 3 --no-timing".split()


@pytest.fixture(autouse=True)
def as_in_a_fresh_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already
    monkeypatch.setattr(registry, "_REGISTERED", dict(registry._REGISTERED))


def blocks(language: str) -> list[str]:
    """The code blocks of the page."""
    page = (DOCS / "write-a-planner.md").read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", page, flags=re.DOTALL)


def test_the_page_shows_the_planner_that_the_tests_run():
    source = (DOCS / "examples" / "my_planner.py").read_text(encoding="utf-8")
    assert blocks("python")[0] in source


def test_the_planner_runs_from_the_command_line(capsys):
    assert main(["evaluate", "--planner", MY_PLANNER, *TINY, "--set", "headings=8"]) == 0
    assert " BestHeading " in capsys.readouterr().out


def test_the_commands_on_the_page_are_understood(capsys, monkeypatch):
    monkeypatch.chdir(DOCS.parent)
    listing, evaluation = (shlex.split(line)[1:] for line in blocks("sh")[0].splitlines())
    assert main(listing) == 0
    assert "headings: a whole number (default 16)" in capsys.readouterr().out
    # Understood up to the point where the work would begin.
    assert main([*evaluation, "--json", "nowhere/out.json"]) == 2
    assert "no folder nowhere" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "right"), [("headings=3", "give a whole number >= 4"), ("step=0.6", "up to half")])
def test_options_out_of_range_are_told_in_one_line(option, right, capsys):
    assert main(["evaluate", "--planner", MY_PLANNER, *TINY, "--set", option]) == 2
    captured = capsys.readouterr().err
    assert right in captured and captured.count("\n") == 1


def test_the_script_compares_and_surveys(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "examples"))
    spec = importlib.util.spec_from_file_location("evaluate_my_planner", DOCS / "examples" / "evaluate_my_planner.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    try:
        traces = script.compare(SCENARIO.replace(budget=1.2, nodes=40, neighbours=8), instances=6, trials=1)
        routes = script.survey(SCENARIO)
    finally:
        sys.modules.pop("my_planner", None)
    assert traces["best-heading"] < traces["random"]
    assert routes.shape[:2] == (1, 2) and np.isfinite(routes).all()


def test_the_snippet_on_the_page_registers_and_evaluates(monkeypatch, capsys):
    monkeypatch.chdir(DOCS.parent)
    snippet = blocks("python")[1].replace("agents=2, budget=2.0", "agents=2, budget=0.6, grid=8").replace("=10", "=2")
    exec(compile(snippet, "write-a-planner.md", "exec"), {})
    assert "mean=" in capsys.readouterr().out
