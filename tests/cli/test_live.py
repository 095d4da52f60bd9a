"""`maipp live` as a program."""

import io
import json
import sys

import pytest

from maipp.cli.main import main

SCENARIO = "agents: 2\nbudget: 1.2\nstart: [0.5, 0.5]\ngrid: 8\nnodes: 16\nneighbours: 5\n"
MISSION = """
metres: true
area: [[0, 0], [400, 0], [400, 300], [0, 300]]
robots: [{name: boat, start: [10, 10], speed: 2.0, budget_m: 600}]
measurement_spacing_m: 80
kernel: {length_scale_m: 120, mean: 8, std: 4}
planner: shared-greedy
scenario: {grid: 8, nodes: 16, neighbours: 5}
"""


@pytest.fixture(autouse=True)
def as_in_a_fresh_process(monkeypatch):
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already


@pytest.fixture
def live(monkeypatch, tmp_path, capsysbinary):
    """Runs the command on lines; gives the exit code, the answers, and standard error."""

    def run(arguments, lines=(), text=SCENARIO):
        (tmp_path / "file.yaml").write_text(text, encoding="utf-8")
        stream = io.BytesIO(b"".join(line.encode() + b"\n" for line in lines))
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(stream))
        code = main(["live", str(tmp_path / "file.yaml"), "--journal", str(tmp_path / "j"), *arguments])
        out, err = capsysbinary.readouterr()
        return code, [json.loads(line) for line in out.splitlines()], err.decode()

    return run


def test_a_scenario_is_served_and_goes_on(live):
    arrived = '{"event": "arrived", "id": "a", "robot": "robot2", "position": [0.5, 0.5], "time": 100}'
    flags = ["--planner", "shared-greedy", "--epoch", "100"]
    code, (ready, go, error), _ = live(flags, [arrived, "nonsense"])
    assert code == 0 and ready["answer"] == "ready" and ready["epoch"] == 100.0 and ready["events"] == 0
    assert go["answer"] == "go" and go["arrival"] > 100 and error["answer"] == "error" and error["line"] == 2
    code, (ready, again), _ = live(flags, [arrived])
    assert (code, ready["events"], again) == (0, 1, go)


def test_a_mission_is_served_in_its_own_units(live):
    arrived = '{"event": "arrived", "id": "a", "robot": "boat", "position": [10, 10], "time": 0}'
    code, (ready, go), err = live([], [arrived], MISSION)
    assert code == 0 and ready["robots"] == [{"name": "boat", "start": [10.0, 10.0], "budget": 600.0, "speed": 2.0}]
    x, y = go["waypoints"][-1]
    assert 0 <= x <= 400 and 0 <= y <= 300
    # 2 m/s, on one straight leg.
    assert go["arrival"] == pytest.approx(((x - 10) ** 2 + (y - 10) ** 2) ** 0.5 / 2, abs=0.01)
    assert all(line.startswith("warning: ") for line in err.splitlines())


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--seed", "-1"], "--seed: -1 is no seed"),
        (["--planner", "gredy"], "gredy"),
        (["--planner", "greedy", "--set", "horizon=3"], "horizon"),
        (["--set", "horizon"], "--set horizon: not an assignment"),
        (["--epoch", "nan"], "--epoch"),
    ],
)
def test_bad_flags_are_told_in_one_line(live, arguments, told, tmp_path):
    code, answers, err = live(arguments)
    assert code == 2 and answers == [] and told in err and err.count("\n") == 1 and not (tmp_path / "j").exists()


@pytest.mark.parametrize(
    ("text", "told"),
    [("agents: none\n", "file.yaml:1: agents"), ("area: 3\n", "file.yaml"), ("robots: [", "file.yaml"), ("", "empty")],
)
def test_bad_files_are_told_in_one_line(live, text, told, tmp_path):
    code, answers, err = live([], text=text)
    assert code == 2 and answers == [] and told in err and err.count("\n") == 1 and not (tmp_path / "j").exists()


def test_a_journal_that_cannot_be_used_is_told(live, tmp_path):
    (tmp_path / "j").write_text("notes\n", encoding="utf-8")
    code, answers, err = live(["--planner", "shared-greedy"])
    assert code == 2 and answers == [] and "j: line 1 is no line of a journal" in err
    assert (tmp_path / "j").read_text(encoding="utf-8") == "notes\n"
