"""The README is true: its example runs, its commands are understood, its links lead somewhere."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest
import tyro

import maipp
from maipp.cli.evaluate import EvaluateFlags, _rows
from maipp.cli.main import command_of, flags_of
from maipp.cli.plan import PlanFlags
from maipp.cli.scenario_flags import ScenarioFlags
from maipp.planners import make_planner, planner_names

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The code blocks in a language."""
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def commands(program: str) -> list[list[str]]:
    """The arguments of every line of the shell blocks that calls a program."""
    lines = [shlex.split(line, comments=True) for block in blocks("sh") for line in block.splitlines()]
    cut = [line[: line.index(">")] if ">" in line else line for line in lines]
    return [line[1:] for line in cut if line and line[0] == program]


@pytest.mark.parametrize("all_cores", [True, False])
def test_the_example_runs(all_cores, monkeypatch, capsys):
    # JAX is running already: True stands for a process that has called use_all_cores.
    monkeypatch.setattr("maipp.devices._configured", all_cores)
    (example,) = blocks("python")
    if not all_cores:
        example = "\n".join(line for line in example.splitlines() if "use_all_cores" not in line)
    exec(compile(example, "README.md", "exec"), {})
    printed = re.fullmatch(r"Tr\(P\) ([\d.]+) of 900, mean of 20 surveys\n", capsys.readouterr().out)
    # docs/protocol.md: 20.8 (0.5) over 200 worlds, so 20 of them lie within 20.8 (1.6).
    assert printed is not None and 16 < float(printed[1]) < 26


def test_the_example_uses_public_names_only():
    used = set(re.findall(r"maipp\.(\w+)", blocks("python")[0]))
    assert used and used <= set(maipp.__all__)


@pytest.mark.parametrize("arguments", commands("maipp"), ids=shlex.join)
def test_the_commands_are_understood(arguments):
    name, rest = command_of(arguments)
    flags = tyro.cli(flags_of(name), args=rest)
    if isinstance(flags, EvaluateFlags):
        assert len(_rows(flags)) >= 2
    elif isinstance(flags, PlanFlags):
        make_planner(flags.planner, flags.to_scenario(), flags.planner_options())
    else:
        assert not isinstance(flags, ScenarioFlags)


def test_modules_that_are_run_exist():
    pages = [README, *(page.read_text(encoding="utf-8") for page in ROOT.glob("docs/**/*.md"))]
    run = {module for page in pages for module in re.findall(r"python -m (maipp[\w.]*)", page)}
    assert all(importlib.util.find_spec(module) for module in run) and run


def test_make_has_the_targets():
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    named = {arguments[0] for arguments in commands("make")}
    in_text = re.findall(r"`make ([\w-]+)", README + CONTRIBUTING) + re.findall(
        r"^ {4}make ([\w-]+)", CONTRIBUTING, re.M
    )
    assert {"demo", "test"} <= named and named | set(in_text) <= targets


def test_the_table_names_every_planner():
    table = README.partition("<!-- table1:start -->")[2].partition("<!-- table1:end -->")[0]
    first_cells = re.findall(r"^\| `([^`]+)`", table, flags=re.MULTILINE)
    # What `foresight` is compared with is in docs/foresight.md: by more than Tr(P), which is all that the table has.
    assert set(first_cells) == set(planner_names()) - {"foresight"}
    assert "maipp benchmark table1" in table  # what made it


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", *(f"docs/{p.name}" for p in ROOT.glob("docs/*.md"))])
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("https://"):
            continue
        path, _, heading = target.partition("#")
        file = (ROOT / page).parent / path if path else ROOT / page
        assert file.exists(), f"{page}: {target}"
        if heading:
            titles = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
            anchors = {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
            assert heading in anchors, f"{page}: {target}"


def test_the_pictures_are_small():
    pictures = re.findall(r"\]\((docs/pictures/[^)]+)\)", README)
    assert pictures
    for picture in pictures:
        content = (ROOT / picture).read_bytes()
        assert content.startswith(b"\x89PNG") and len(content) < 300_000
