"""`maipp survey`: from a mission file to files for the robots, and one clear line for what is wrong."""

import json
import re
from importlib.util import find_spec

import numpy as np
import pytest

from maipp.cli.main import main
from maipp.cli.survey import SurveyFlags, _sizes, run
from maipp.engine.episode_io import read_episode
from maipp.errors import InputError
from maipp.surveys.survey_io import load_survey
from maipp.surveys.template import TEMPLATE
from tests.surveys.conftest import SQUARE


@pytest.fixture(autouse=True)
def devices_are_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """JAX is running already, with the devices that tests/conftest.py asked for."""
    monkeypatch.setattr("maipp.devices._configured", True)


@pytest.fixture
def mission(tmp_path):
    path = tmp_path / "mission.yaml"
    path.write_text(SQUARE, encoding="utf-8")
    return path


def test_new_writes_the_template_once(tmp_path, capsys):
    path = tmp_path / "new.yaml"
    assert main(["survey", "--new", str(path)]) == 0
    assert load_survey(path).name == "lake"
    assert main(["survey", "--new", str(path)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["survey", "--new"]) == 0
    assert capsys.readouterr().out == TEMPLATE


def test_check_says_what_will_be_planned_and_writes_nothing(mission, capsys):
    assert main(["survey", str(mission), "--check", "--out", str(mission.parent / "out")]) == 0
    printed = capsys.readouterr().out
    assert "square, 2 robots, shared-greedy" in printed and "above 12 g/L" in printed and "a valid mission" in printed
    assert "mean 10, std 4 g/L, length scale 300 m" in printed and "std 0.4 g/L of a measurement" in printed
    assert [path.name for path in mission.parent.iterdir()] == ["mission.yaml"]


def test_a_planned_survey_leaves_files_and_a_table(mission, capsys):
    out = mission.parent / "out"
    assert main(["survey", str(mission), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    names = {path.name for path in out.iterdir()}
    assert {"waypoints.csv", "routes-in-metres.json", "episode.json", "overview.png"} <= names
    assert ("report.html" in names) == (find_spec("plotly") is not None) and "kernel.png" not in names
    assert all(f"wrote {out / name}" in printed for name in names)
    before, after = (line.split() for line in printed.splitlines() if line.split()[:1] == ["one"])
    assert before[3:] == ["2", "1500", "12.5", "0", "anywhere", "-"]
    assert after[1:5] == ["1500", "100%", "12.5", "5"]
    assert read_episode(out / "episode.json").geo.value_name == "salt (g/L)"
    json.loads((out / "routes-in-metres.json").read_text(encoding="utf-8"))


def test_old_samples_leave_a_picture_of_their_kernel(mission, capsys):
    x, y = np.random.default_rng(2).uniform(0, 1000, (2, 40))
    rows = "\n".join(
        f"{a:.1f},{b:.1f},{10 + 3 * np.sin(a / 150) + np.cos(b / 100):.3f}" for a, b in zip(x, y, strict=True)
    )
    (mission.parent / "old.csv").write_text(f"x,y,salt\n{rows}\n", encoding="utf-8")
    kernel = next(line for line in SQUARE.splitlines() if line.startswith("kernel:"))
    mission.write_text(SQUARE.replace(kernel, "samples: old.csv"), encoding="utf-8")
    out = mission.parent / "out"
    assert main(["survey", str(mission), "--out", str(out)]) == 0
    fitted = re.search(r"fitted\s+to\s+(\d+)\s+samples", capsys.readouterr().out)
    assert (out / "kernel.png").read_bytes().startswith(b"\x89PNG")
    prior = read_episode(out / "episode.json").prior
    assert fitted and prior is not None and 30 < len(prior.y) == int(fitted[1])


def test_a_rehearsal_leaves_a_report(mission, capsys):
    out = mission.parent / "out"
    assert main(["survey", str(mission), "--rehearse", "--robots", "1", "--fields", "2", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert {path.name for path in out.iterdir()} == {"rehearsal.csv", "rehearsal.md", "rehearsal.png"}
    assert "1 robot with shared-greedy: the error falls" in printed


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ([], "no mission file; give one"),
        (["nowhere.yaml"], "nowhere.yaml: cannot read the mission"),
        (["MISSION", "--seed", "-1"], "--seed: -1 is no seed"),
        (["MISSION", "--robots", "1..2"], "--robots: says what to rehearse; add --rehearse"),
        (["MISSION", "--rehearse", "--planner", "greedy"], "--planner: a rehearsal may have several"),
        (["MISSION", "--rehearse", "--fields", "0"], "--fields: 0 is not a number of fields"),
        (["MISSION", "--rehearse", "--robots", "3..1"], "--robots: '3..1' is no size of a team"),
        (["MISSION", "--planner", "gredy"], "mission.yaml:15: planner: no planner 'gredy' (did you mean greedy?)"),
        (["MISSION", "--set", "shraed=1"], "no option 'shraed' (did you mean shared?)"),
        (["MISSION", "--rehearse", "--raster", "nowhere.npz"], "nowhere.npz: no such file"),
    ],
)
def test_what_is_wrong_is_one_line(arguments, problem, mission, capsys):
    given = [str(mission) if each == "MISSION" else each for each in arguments]
    assert main(["survey", *given, "--out", str(mission.parent / "out")]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and problem in captured.err and captured.err.count("\n") == 1
    assert not list((mission.parent / "out").glob("*"))


def test_sizes_of_teams_are_spelt_three_ways():
    assert _sizes("1..3") == (1, 2, 3) and _sizes("2") == (2,) and _sizes("1,4") == (1, 4) and _sizes(None) == ()
    with pytest.raises(InputError):
        _sizes("many")


def test_a_failed_survey_leaves_nothing(mission, monkeypatch):
    def broken(*arguments, **options):
        raise InputError("no")

    monkeypatch.setattr("maipp.surveys.picture.draw_plan", broken)
    with pytest.raises(InputError):
        run(SurveyFlags(mission=mission, out=mission.parent / "out"))
    assert list((mission.parent / "out").iterdir()) == []
