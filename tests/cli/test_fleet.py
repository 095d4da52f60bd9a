"""`maipp robot` and `maipp fleet` as programs."""

import json

import pytest

from maipp.cli.main import main

SCENARIO = "agents: 2\nbudget: 0.8\nstart: [0.5, 0.5]\nend: start\ngrid: 8\nnodes: 16\nneighbours: 5\n"


@pytest.fixture(autouse=True)
def as_in_a_fresh_process(monkeypatch):
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already


@pytest.fixture
def run(tmp_path, capsys):
    """Runs a command on a scenario file; gives the exit code, and what was printed."""

    def called(command, *arguments, text=SCENARIO):
        file = tmp_path / "file.yaml"
        file.write_text(text, encoding="utf-8")
        code = main([command, str(file), *arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return called


ROBOT = ("--name", "robot1", "--planner", "greedy")


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--name", "robot9"), "--name: 'robot9' is no robot of the mission; there is robot1, robot2"),
        ((*ROBOT, "--listen", "tcp/0.0.0.0:7447"), "--listen: tcp/0.0.0.0:7447 is open to others"),
        ((*ROBOT, "--connect", "10.0.0.2"), "--connect: '10.0.0.2' is no address"),
        ((*ROBOT, "--keys", "nowhere"), "nowhere"),
        ((*ROBOT, "--vehicle", "submarine"), "--vehicle submarine: not known; there is "),
        ((*ROBOT, "--vehicle", "simulated", "--with", "wings=2"), "--with wings: not known"),
        ((*ROBOT, "--vehicle", "simulated", "--with", "drift=2"), "drift"),
        ((*ROBOT, "--vehicle", "simulated", "--with", "raster=map.tif"), "a scenario file has no place"),
        ((*ROBOT, "--loss", "1"), "--loss: 1.0 is no share"),
        ((*ROBOT, "--range", "-1"), "--range: -1.0 is no distance"),
        ((*ROBOT, "--speedup", "60"), "--speedup: lines is no simulated vehicle"),
        ((*ROBOT, "--speedup", "nan"), "--speedup: nan is no number of times"),
        ((*ROBOT, "--held"), "--held: standard input may be the vehicle's (lines)"),
        ((*ROBOT, "--epoch", "inf"), "--epoch: inf is no time"),
        ((*ROBOT, "--seed", "-1"), "--seed"),
    ],
)
def test_what_a_robot_cannot_start_with_is_told_in_one_line(run, tmp_path, arguments, problem):
    code, out, err = run("robot", "--log", str(tmp_path / "log"), *arguments)
    errors = [line for line in err.splitlines() if line.startswith("error: ")]
    assert code == 2 and not out and len(errors) == 1 and problem in errors[0], err


def test_names_that_cannot_be_sent_are_refused(run, tmp_path):
    text = (
        "metres: true\narea: [[0, 0], [400, 0], [400, 300], [0, 300]]\nmeasurement_spacing_m: 80\n"
        "robots: [{name: boat/1, start: [10, 10], speed: 2.0, budget_m: 600}]\n"
        "kernel: {length_scale_m: 120, mean: 8, std: 4}\nplanner: shared-greedy\n"
        "scenario: {grid: 8, nodes: 16, neighbours: 5}\n"
    )
    code, _, err = run("robot", "--name", "boat/1", "--log", str(tmp_path / "log"), text=text)
    assert code == 2 and "'boat/1' is no name of a robot in a fleet" in err


def test_a_folder_of_another_mission_is_refused(run, tmp_path):
    from maipp.fleet.logs import Logs

    logs = Logs(tmp_path / "log", "robot1", "b" * 64)
    logs.append({"event": 1})
    logs.close()
    code, _, err = run("robot", "--log", str(tmp_path / "log"), *ROBOT)
    assert code == 2 and "a log of another mission, planner, seed or epoch" in err


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((), "give --simulate to run a fleet here, or --connect ADDRESS"),
        (("--simulate", "--connect", "tcp/127.0.0.1:1"), "--simulate: talks within this computer only"),
        (("--simulate", "--speedup", "0"), "--speedup: 0.0 is no number of times"),
        (("--simulate", "--loss", "-0.1"), "--loss: -0.1 is no share"),
        (("--simulate", "--range", "0"), "--range: 0.0 is no distance"),
        (("--simulate", "--with", "bad"), "--with bad: not an assignment"),
    ],
)
def test_what_a_fleet_cannot_be_is_told_in_one_line(run, tmp_path, arguments, problem):
    code, out, err = run("fleet", "--out", str(tmp_path / "out"), *arguments)
    assert code == 2 and not out and err.count("error: ") == 1 and problem in err, err


def test_a_folder_that_is_something_else_is_left_alone(run, tmp_path):
    mine = tmp_path / "out" / "robots" / "robot1" / "thesis.tex"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    code, _, err = run("fleet", "--simulate", "--planner", "greedy", "--out", str(tmp_path / "out"))
    assert code == 2 and "is no folder of a simulated robot" in err and mine.read_text() == "mine"


@pytest.mark.slow
def test_a_simulated_fleet_comes_home_with_a_result(run, tmp_path):
    out, more = tmp_path / "out", ("--simulate", "--planner", "greedy", "--speedup", "0.5", "--page", "none")
    for _ in range(2):  # the second time in the place of the first
        code, told, err = run("fleet", *more, "--loss", "0.2", "--range", "0.5", "--out", str(out))
        assert code == 0, err
        assert "result.json" in told and err.count(" done: ") == 2
    numbers = json.loads((out / "result" / "result.json").read_text())
    assert [robot["name"] for robot in numbers["robots"]] == ["robot1", "robot2"]
    assert all(robot["came_home"] for robot in numbers["robots"])
    assert numbers["samples"]["taken"] > 2
