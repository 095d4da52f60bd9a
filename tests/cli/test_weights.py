"""`--weights FILE`: whose option it sets, and the one line for a file that is none."""

import json

import equinox as eqx
import jax
import pytest

from maipp.cli.evaluate import EvaluateFlags, _rows
from maipp.cli.main import main
from maipp.cli.plan import PlanFlags, run
from maipp.engine.episode_io import read_episode
from maipp.errors import InputError
from maipp.policy import PolicyNetwork, save_weights

TINY = "--agents 2 --budget 0.4 --set scenario.grid=6 scenario.nodes=12 scenario.neighbours=4".split()
COMMANDS = [["plan", "--no-animation"], ["evaluate", "--instances", "2", "--trials", "1", "--no-timing"]]


@pytest.fixture(autouse=True)
def devices_are_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """JAX is running already, with the devices that tests/conftest.py asked for."""
    monkeypatch.setattr("maipp.devices._configured", True)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "tiny.safetensors"
    make = eqx.filter_jit(lambda key: PolicyNetwork(key, width=16, heads=2, encoding_dimensions=4))
    save_weights(make(jax.random.key(0)), path, {})
    return path


def test_a_survey_is_planned_with_the_weights_of_a_file(weights, tmp_path):
    flags = PlanFlags(
        planner="sga-catnipp",
        weights=str(weights),
        agents=2,
        budget=(0.4,),
        settings=(("scenario.grid=6", "scenario.nodes=12", "scenario.neighbours=4"),),
        out=tmp_path,
        animation=False,
    )
    assert run(flags) == 0
    assert read_episode(tmp_path / "episode.json").options == {"weights": str(weights)}


def test_weights_go_to_the_planners_that_have_them(weights, tmp_path, capsys):
    out = tmp_path / "out.json"
    planners = ["--planner", "random", "sga-catnipp", "--weights", str(weights), "--json", str(out)]
    assert main([*COMMANDS[1], *TINY, *planners]) == 0
    rows = json.loads(out.read_text(encoding="utf-8"))["evaluations"]
    assert [row["options"].get("weights") for row in rows] == [None, str(weights)]
    assert "sga-catnipp" in capsys.readouterr().out


def test_every_planner_with_a_policy_gets_them(weights):
    planners = ("greedy", "sga-catnipp", "di", "ti", "intent-paths")
    rows = _rows(EvaluateFlags(planner=planners, weights=str(weights), settings=(("steps=2",),)))
    assert [options for *_, options in rows] == [
        {},
        {"weights": str(weights)},
        *[{"steps": "2", "weights": str(weights)}] * 3,
    ]


def test_untrained_is_a_name_too():
    ((_, _, options),) = _rows(EvaluateFlags(planner=("ti",), weights="untrained"))
    assert options == {"weights": "untrained"}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_what_is_wrong_with_the_file_is_one_line(command, weights, tmp_path, capsys):
    short = tmp_path / "short.safetensors"
    short.write_bytes(weights.read_bytes()[:-100])
    short.with_suffix(".json").write_bytes(weights.with_suffix(".json").read_bytes())
    text = tmp_path / "text.safetensors"
    text.write_text("no weights", encoding="utf-8")
    text.with_suffix(".json").write_text("{}", encoding="utf-8")
    for path, problem in (
        (short, "short.safetensors: not a safetensors file, or cut short"),
        (text, "text.json: architecture: missing"),
        (tmp_path / "nowhere.safetensors", "nowhere.json: cannot be read"),
        (weights.with_suffix(".json"), "or a .safetensors file"),
    ):
        out = ["--out", str(tmp_path / "out")] if command[0] == "plan" else []
        assert main([*command, *TINY, "--planner", "ti", "--weights", str(path), *out]) == 2
        captured = capsys.readouterr()
        assert captured.err.startswith("error: planner ti: ") and problem in captured.err
        assert captured.err.count("\n") == 1 and captured.out == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_weights_for_nobody_are_refused(command, weights, capsys):
    assert main([*command, *TINY, "--planner", "greedy", "--weights", str(weights)]) == 2
    expected = "error: --weights: no planner given has a policy; give --planner, one or more of sga-catnipp, di, ti, "
    assert capsys.readouterr().err == f"{expected}ti-star, intent-paths, intent-search\n"


@pytest.mark.parametrize("kind", [PlanFlags, EvaluateFlags])
def test_weights_given_twice_are_refused(kind):
    flags = kind(weights="a.safetensors", settings=(("weights=b.safetensors",),))
    with pytest.raises(InputError, match="--weights: given again as --set weights; keep one"):
        flags.planner_options()
