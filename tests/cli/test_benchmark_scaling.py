"""The scaling command: bad flags are refused before any work, and a run goes on where it was."""

import dataclasses

import pytest

from maipp.cli import benchmark_scaling
from maipp.cli.benchmark_scaling import ScalingFlags, run
from maipp.errors import InputError

TINY = {"agents": 2, "measurements": 4, "grid": 5, "nodes": 12}


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ({"planner": ()}, "--planner: none given"),
        ({"planner": ("shared-gredy",)}, "shared-greedy"),
        ({"decisions": 0}, "--decisions: 0 is too few"),
        ({"surveys": -1}, "--surveys: -1 is too few"),
        ({"capacity": 0}, "--capacity: 0 is too few"),
        ({"length_scale": 0.0}, "--length-scale: 0.0 is no length"),
    ],
)
def test_bad_flags_are_refused(tmp_path, flags, said):
    with pytest.raises(InputError, match=said):
        run(dataclasses.replace(ScalingFlags(tmp_path / "out"), **flags))
    assert not (tmp_path / "out").exists()


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="is a file"):
        run(ScalingFlags(tmp_path / "out"))


def test_a_run_writes_its_files_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    for name, value in {"AXES": {"grid": (4, 5)}, "BASE": TINY, "LARGEST": TINY}.items():
        monkeypatch.setattr(benchmark_scaling, name, value)
    flags = ScalingFlags(tmp_path / "out", planner=("lawnmower",), decisions=2, surveys=0)
    assert run(flags) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"scaling.json", "scaling.csv", "errors.csv", "scaling.md", "scaling.png"}
    assert capsys.readouterr().err.count(" ms, ") == 3
    before = (tmp_path / "out" / "scaling.csv").read_text()
    assert run(flags) == 0
    assert (tmp_path / "out" / "scaling.csv").read_text() == before and " ms, " not in capsys.readouterr().err
