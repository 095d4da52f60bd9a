"""Every code block of the pages in docs/ is run, or read as its reader would read it.

- python: run from its page in an empty folder that holds what the page speaks of.
- sh: every command is parsed with the real flags, up to where the work would begin; planners are made, keys of
  configurations looked up. Programs other than maipp: the file, the target or the extra that is named must exist.
- yaml, json: read.
"""

import configparser
import importlib.util
import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import NamedTuple

import jax
import pytest
import tyro

import maipp
from maipp.bench.tables import TABLES, read_table
from maipp.cli import benchmark
from maipp.cli.benchmark import BenchmarkFlags
from maipp.cli.benchmark_table import TableFile, TableFlags
from maipp.cli.evaluate import EvaluateFlags, _rows
from maipp.cli.main import COMMANDS, command_of, flags_of
from maipp.cli.plan import PlanFlags
from maipp.cli.train import TrainFlags
from maipp.engine.episode import Episode
from maipp.engine.episode_io import write_episode
from maipp.planners import make_planner, registry
from maipp.training.config import TrainConfig
from maipp.training.config_io import find_config, override

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
# Of this page tests/test_docs_examples.py runs the blocks, in smaller surveys.
RUN_ELSEWHERE = {"write-a-planner.md"}


class Block(NamedTuple):
    """One code block."""

    page: str
    line: int
    language: str
    text: str


def blocks_of(text: str, page: str) -> list[Block]:
    """The fenced blocks of a page that name a language."""
    found = re.finditer(r"^( *)```(\w+)[^\n]*\n(.*?)^\1```$", text, flags=re.DOTALL | re.MULTILINE)
    return [Block(page, text[: match.start()].count("\n") + 1, match[2], match[3]) for match in found]


BLOCKS = [
    block
    for path in sorted(DOCS.rglob("*.md"))
    for block in blocks_of(path.read_text(encoding="utf-8"), str(path.relative_to(DOCS)))
]


def of(*languages: str) -> list[Block]:
    """The blocks in these languages."""
    return [block for block in BLOCKS if block.language in languages]


def name(block: Block) -> str:
    """The place of a block, for the names of tests."""
    return f"{block.page}:{block.line}"


def test_every_block_is_in_a_language_that_is_tested():
    assert {block.language for block in BLOCKS} <= {"python", "sh", "yaml", "json", "csv", "xml", "ini", "toml", "text"}
    assert len(of("sh")) > 5 and len(of("python")) > 3


# What a page's Python blocks find in their folder.


def _an_episode(folder: Path) -> None:
    """The record that `maipp plan --out out/plan` leaves, of a smaller survey."""
    scenario = maipp.Scenario(agents=3, budget=0.6, grid=8, nodes=12, neighbours=4)
    planner = maipp.make_planner("random", scenario)
    missions = maipp.draw_missions(scenario, seed=0, instances=1)
    states = maipp.run_missions(planner, missions, jax.random.key(0))
    (folder / "out" / "plan").mkdir(parents=True)
    write_episode(Episode.from_state(scenario, "random", {}, 0, missions, states), folder / "out/plan/episode.json")


def _the_scenario(folder: Path) -> None:
    """The file that the page shows."""
    (block,) = [block for block in of("yaml") if block.page == "scenario.md"]
    (folder / "survey.yaml").write_text(block.text, encoding="utf-8")


PREPARE = {"episode.md": _an_episode, "scenario.md": _the_scenario}
NEEDS = {"pettingzoo.md": "pettingzoo"}


@pytest.fixture
def as_in_a_fresh_process(monkeypatch):
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already
    monkeypatch.setattr(registry, "_REGISTERED", dict(registry._REGISTERED))


PAGES_WITH_PYTHON = sorted({block.page for block in of("python")} - RUN_ELSEWHERE)


@pytest.mark.parametrize("page", PAGES_WITH_PYTHON)
def test_python_runs(page, tmp_path, monkeypatch, as_in_a_fresh_process, capsys):
    if page in NEEDS:
        pytest.importorskip(NEEDS[page])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(DOCS)
    PREPARE.get(page, lambda folder: None)(tmp_path)
    names: dict[str, object] = {}  # later blocks of a page may use the names of earlier ones
    for block in of("python"):
        if block.page == page:
            exec(compile("\n" * block.line + block.text, page, "exec"), names)
    for left in ("nan", "Traceback"):
        assert left not in capsys.readouterr().out


def _launched(piece: list[str]) -> list[str]:
    """What `srun` launches: all after its own options."""
    return piece[next(at for at, word in enumerate(piece[1:], 1) if not word.startswith("-")) :]


def commands_of(text: str) -> list[list[str]]:
    """The words of every command of a shell block, without comments, redirections and SLURM's launcher."""
    found = []
    for line in text.replace("\\\n", " ").splitlines():
        words = [word if word not in ("|", "&&", ";", "&") else None for word in shlex.split(line, comments=True)]
        while words:
            end = words.index(None) if None in words else len(words)
            piece = [word for word in words[:end] if word is not None]
            words = words[end + 1 :]
            redirected = (at for at, word in enumerate(piece) if word[:1] in ("<", ">"))
            piece = piece[: next(redirected, len(piece))]
            found.append(_launched(piece) if piece[0] == "srun" else piece)
    return found


COMMAND_LINES = [(name(block), words) for block in of("sh") for words in commands_of(block.text)]


def understood(arguments: list[str]) -> None:
    """Fails where the command line would refuse these arguments of `maipp` before any work begins."""
    command, rest = command_of(arguments)
    assert command in COMMANDS, f"no command {command}"
    rest = benchmark.arguments(rest) if command == "benchmark" else rest
    flags = tyro.cli(flags_of(command), args=rest)
    if isinstance(flags, PlanFlags):
        make_planner(flags.planner, flags.to_scenario(), flags.planner_options())
    elif isinstance(flags, TrainFlags):
        given = flags.config or "default"
        config = TrainConfig() if given.endswith(".yaml") else find_config(given)
        # Weights that an earlier command of the page makes are not there yet.
        override(config, (item for group in flags.settings for item in group if not item.startswith("start=runs/")))
    elif isinstance(flags, EvaluateFlags):
        options = [item for group in flags.settings for item in group]
        if not any(item.startswith("weights=runs/") for item in options):
            assert flags.merge or _rows(flags)
    elif isinstance(flags, BenchmarkFlags) and isinstance(flags.name, TableFile):
        assert flags.name.file.suffix == ".yaml"
    elif isinstance(flags, BenchmarkFlags) and isinstance(flags.name, TableFlags):
        assert TABLES[flags.name.table].chosen(flags.name.planners)


@pytest.mark.parametrize(("where", "words"), COMMAND_LINES, ids=[f"{w} {shlex.join(c)[:60]}" for w, c in COMMAND_LINES])
def test_commands_are_understood(where, words, monkeypatch, as_in_a_fresh_process):
    monkeypatch.chdir(ROOT)
    program, *rest = words
    if program == "maipp":
        understood(rest)
    elif program == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert rest[0] in targets
    elif program == "python" and rest[0] == "-m":
        assert importlib.util.find_spec(rest[1])
    elif program == "python":
        assert (ROOT / rest[0]).is_file()
    elif program == "pip":
        (extras,) = re.findall(r"maipp\[([\w,]+)\]", shlex.join(rest))
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        assert set(extras.split(",")) <= set(project["optional-dependencies"])
    else:
        assert program in ("cat", "cd", "echo", "mkdir", "head", "tail", "export"), f"{where}: nothing checks {program}"


@pytest.mark.parametrize("block", of("ini"), ids=name)
def test_units_start_what_there_is(block):
    unit = configparser.ConfigParser()
    unit.read_string(block.text)
    program, *rest = shlex.split(unit["Service"]["ExecStart"])
    assert Path(program).name == "maipp"
    understood(rest)


@pytest.mark.parametrize("block", of("toml"), ids=name)
def test_toml_is_read(block):
    assert tomllib.loads(block.text)


# Stands in for the files that a mission names: a square of some hundred metres, and samples in it.
STAND_IN = {
    ".geojson": '{"type": "Polygon", "coordinates": '
    "[[[4.73, 52.24], [4.74, 52.24], [4.74, 52.25], [4.73, 52.25], [4.73, 52.24]]]}",
    ".csv": "longitude,latitude,value\n4.731,52.241,3.0\n4.735,52.245,9.0\n4.738,52.248,5.0\n",
}


@pytest.mark.parametrize("block", of("yaml"), ids=name)
def test_yaml_is_read(block, tmp_path, monkeypatch):
    """A mission of a real place has an `area`; all else describes a scenario or a training run."""
    import yaml

    monkeypatch.chdir(ROOT)
    keys = yaml.safe_load(block.text)
    assert isinstance(keys, dict)
    if "area" in keys:
        pytest.importorskip("pyproj")
        for file in re.findall(r"[\w-]+\.(?:geojson|csv)", block.text):
            (tmp_path / file).write_text(STAND_IN[Path(file).suffix], encoding="utf-8")
        module = importlib.import_module("maipp.surveys.survey_io")
        module.parse_survey(block.text, source=block.page, folder=tmp_path)
    elif "columns" in keys:
        path = tmp_path / "table.yaml"
        path.write_text(block.text, encoding="utf-8")
        assert len(read_table(path).rows) > 1
    elif set(keys) <= set(maipp.Scenario.__dataclass_fields__):
        path = tmp_path / "survey.yaml"
        path.write_text(block.text, encoding="utf-8")
        assert maipp.load_scenario(path) != maipp.Scenario()
    else:
        assert set(keys) <= set(TrainConfig.__dataclass_fields__)


@pytest.mark.parametrize("block", of("json"), ids=name)
def test_json_is_read(block):
    try:
        json.loads(block.text)
    except json.JSONDecodeError:  # one value a line
        values = [json.loads(line) for line in block.text.splitlines() if line.strip()]
        assert len(values) > 1


# The checks must be able to fail.


@pytest.mark.parametrize(
    "line",
    [
        "maipp survive",
        "maipp plan --planners greedy",
        "maipp plan --planner gredy --out x",
        "maipp benchmark table1 --planners gredy --out x",
        "maipp train --set sed=1 --out x",
        "maipp evaluate --planner greedy --set horizon=3 --out x",
    ],
)
def test_a_command_that_is_wrong_is_found(line, as_in_a_fresh_process):
    ((_, *arguments),) = commands_of(line)
    with pytest.raises((AssertionError, SystemExit, ValueError)):
        understood(arguments)


def test_blocks_and_commands_are_told_apart():
    page = (
        "a\n```sh\n# no\nmaipp scenario > x.yaml  # yes\nmaipp a | head -1\nsrun maipp b \\\n  c\n```\n```\nfree\n```\n"
    )
    (block,) = blocks_of(page, "page.md")
    assert block.line == 2 and commands_of(block.text) == [
        ["maipp", "scenario"],
        ["maipp", "a"],
        ["head", "-1"],
        ["maipp", "b", "c"],
    ]
