"""`maipp train`: flags, what it prints, and a whole run."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from rich.console import Console

from maipp.cli import train as command
from maipp.cli.main import main
from maipp.cli.train import TrainFlags, _shown
from maipp.errors import InputError
from maipp.training import train as loop
from maipp.training.config import NAMED, TrainConfig
from maipp.training.config_io import POLICY, dump_config
from maipp.training.held_out import HeldOut
from maipp.training.train import Step


@pytest.fixture
def small(fake, monkeypatch, tmp_path):
    """`maipp train` with a learner that takes no time; the configuration file to give."""
    monkeypatch.setattr(loop, "HeldOutWorlds", fake.FakeWorlds)
    monkeypatch.setattr(loop, "Learner", lambda config, devices: fake.FakeLearner())
    monkeypatch.setattr("maipp.cli.main.prepare_jax", lambda: None)
    path = tmp_path / "small.yaml"
    path.write_text(dump_config(fake.fake_config(3)))
    return str(path)


def test_a_run_says_what_it_wrote(small, tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["train", "--config", small, "--set", "seed=5", "--out", str(out)]) == 0
    printed = capsys.readouterr()
    for name in ("best.safetensors", "final.safetensors", "log.jsonl", "learning_curve.png"):
        assert f"wrote {out / name}" in printed.out and (out / name).exists()
    assert "3 updates, 24 transitions" in printed.out and "update 1 of 3" in printed.err
    card = json.loads((out / "best.json").read_text())
    assert card["seed"] == 5 and card["machine"]["cores"] >= 1 and card["versions"]["jax"]


def test_a_folder_in_use_exits_with_two_and_resume_needs_no_configuration(small, tmp_path, capsys):
    out = str(tmp_path / "run")
    assert main(["train", "--config", small, "--out", out]) == 0
    assert main(["train", "--config", small, "--out", out]) == 2
    assert "holds a training run already" in capsys.readouterr().err
    assert main(["train", "--resume", "--out", out]) == 0
    assert main(["train", "--resume", "--out", out, "--set", "clip=0.3"]) == 2
    assert "has clip 0.2, this one 0.3" in capsys.readouterr().err


def test_divergence_exits_with_two(small, fake, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(loop, "Learner", lambda config, devices: fake.FakeLearner(breaks=2))
    assert main(["train", "--config", small, "--out", str(tmp_path / "run")]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert "diverged in update 2" in line and os.path.join("checkpoints", "000001") in line


def test_an_interrupt_exits_with_130(small, tmp_path, capsys, monkeypatch):
    def interrupted(*args, **kwargs):
        record = loop.RunProgress(update=2)
        return loop.TrainResult(record, True, tmp_path / "checkpoints" / "000002")

    monkeypatch.setattr(command, "train", interrupted)
    assert main(["train", "--config", small, "--out", str(tmp_path / "run")]) == 130
    assert "interrupted after update 2" in capsys.readouterr().err


def test_the_configuration_that_the_flags_name(tmp_path):
    def named(flags):
        return flags.configuration(POLICY)

    assert named(TrainFlags(out=tmp_path)) == NAMED["default"]
    assert named(TrainFlags(out=tmp_path, resume=True)) == NAMED["default"]
    assert named(TrainFlags(out=tmp_path, config="paper", settings=(("seed=1",), ("clip=0.1", "value=1")))) == NAMED[
        "paper"
    ].replace(seed=1, clip=0.1, value=1.0)
    (tmp_path / "config.yaml").write_text(dump_config(TrainConfig(seed=9)))
    assert named(TrainFlags(out=tmp_path, resume=True)).seed == 9
    assert named(TrainFlags(out=tmp_path)).seed == 0
    with pytest.raises(InputError, match="--set: sed: no such key"):
        named(TrainFlags(out=tmp_path, settings=(("sed=1",),)))


def test_progress_is_a_line_now_and_then(tmp_path):
    with open(tmp_path / "notes", "w") as file:
        with _shown(Console(file=file, soft_wrap=True), TrainConfig(updates=9, imitation=0, search=0)) as show:
            for update in (1, 2, 3):
                show(Step(update, 9, 8 * update, 1.0, {"loss": 0.25, "final_trace": float("nan")}))
            show(Step(3, 9, 24, 1.0, {}, HeldOut(12.34, 0.5, 1.0)))
    lines = (tmp_path / "notes").read_text().splitlines()
    assert lines == ["update 1 of 9, 1 s: loss 0.25", "update 3: held-out Tr(P) 12.34 (0.5)"]


@pytest.mark.slow
def test_smoke_runs_start_to_finish_and_improves_on_its_start(tmp_path):
    out = tmp_path / "smoke"
    # Compiled in full, whatever the tests have: it computes for longer than it compiles.
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "XLA_FLAGS": ""}
    # One kind of mission, so that 20 updates can show a gain; tests/training/test_ranges.py has the ranges.
    same = "team=none budget=2,2 length_scale=0.45 threshold=0.4 beta=1 noise=1e-6 measurement_interval=0.2 speed=1"
    arguments = [sys.executable, "-m", "maipp", "train", "--config", "smoke", "--out", str(out)]
    arguments += ["--set", *same.split(), "comm_range=none", "updates=20", "evaluate_every=10"]
    done = subprocess.run(arguments, env=environment, timeout=900, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]
    # The behaviour that is trained, steps sampled. Held out, intent-paths has little to gain in so few updates: it
    # ranks its paths by their outcome, so that even random weights start low.
    ended = [row for row in rows if row.get("missions_ended")]
    assert np.isfinite([row["loss"] for row in rows if "loss" in row]).all()
    start, end = (
        np.average([row["final_trace"] for row in part], weights=[row["missions_ended"] for row in part])
        for part in ([row for row in ended if row["update"] <= 7], [row for row in ended if row["update"] > 13])
    )
    assert end < 0.7 * start
    held_out = [row["update"] for row in rows if "evaluation" in row]
    assert held_out == [0, 10, 20]
