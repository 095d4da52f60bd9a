"""The guide tells every key, and its examples run."""

import re
from pathlib import Path

import pytest

from maipp.cli.main import main
from maipp.surveys import survey_io

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "survey.md").read_text(encoding="utf-8")


def test_every_key_has_its_row():
    table = PAGE.partition("## The mission file")[2].partition("\n## ")[0]
    named = re.findall(r"^\| `([^`]+)`", table, flags=re.MULTILINE)
    expected = [key for key in survey_io.KEYS if key != "kernel"]
    expected += [f"robots[].{key}" for key in survey_io.ROBOT_KEYS] + [f"kernel.{key}" for key in survey_io.KERNEL_KEYS]
    assert sorted(named) == sorted(expected)
    others = survey_io.VEHICLE_KEYS + survey_io.SCENARIO_KEYS + survey_io.REHEARSAL_KEYS
    assert set(others) <= set(re.findall(r"`([a-z_]+)`", table))
    samples = PAGE.partition("### Old samples")[2].partition("Positions may")[0]
    rows = re.findall(r"^\| (`.*?`) \|", samples, flags=re.MULTILINE)
    assert sorted(re.findall(r"`([a-z_]+)`", " ".join(rows))) == sorted(survey_io.SAMPLE_KEYS)


def test_the_mission_on_the_page_is_one(tmp_path):
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    ring = "[[4.73,52.24],[4.746,52.24],[4.746,52.25]]"
    for name in ("lake", "reeds"):
        content = f'{{"type": "Polygon", "coordinates": [{ring}]}}'
        (tmp_path / f"{name}.geojson").write_text(content, encoding="utf-8")
    (tmp_path / "last-year.csv").write_text("lon,lat,value\n", encoding="utf-8")
    survey = survey_io.parse_survey(block, folder=tmp_path)
    assert len(survey.no_go) == 2 and survey.samples is not None


def test_the_commands_on_the_page_are_understood(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("maipp.devices._configured", True)
    monkeypatch.chdir(tmp_path)
    lines = re.findall(r"^maipp (survey [^#\n]*)", PAGE, flags=re.MULTILINE)
    assert len(lines) == 4
    for line in lines:
        # Understood up to the point where the work would begin, on a file that is not there.
        code = main([*line.replace("mission.yaml", "none/mission.yaml").split()])
        assert code == 2 and "none/mission.yaml" in capsys.readouterr().err


@pytest.mark.slow
def test_the_example_in_python_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    exec(compile(block, "survey.md", "exec"), {})
    assert "-123." in capsys.readouterr().out
