"""`maipp train foresight`: its flags, and what it prints."""

import pytest

from maipp.cli import train_foresight as command
from maipp.cli.main import main
from maipp.training.foresight.config import NAMED
from maipp.training.foresight.run import FitResult, FitStep
from maipp.training.run_folder import RunProgress

SCORES = {
    "learned_rmse": 0.1, "fitted_rmse": 0.12, "belief_rmse": 0.16, "learned_nll": -1.2, "fitted_nll": -1.0,
}  # fmt: skip


@pytest.fixture
def called(monkeypatch):
    """The configurations that training was asked for; it ends at once, or is interrupted where the seed is 13."""
    configs = []

    def train(config, out, *, resume, progress, tell, about):
        configs.append((config, resume))
        tell("routes 1 of 1: 16 of lawnmower")
        progress(FitStep(1, 8, 2.0, {"loss": 0.5}))
        progress(FitStep(4, 8, 9.0, {}, SCORES))
        assert set(about) == {"machine", "versions"}
        return FitResult(RunProgress(update=4, transitions=640, wall_s=9.0), config.seed == 13)

    monkeypatch.setattr(command, "train_foresight", train)
    return configs


def test_flags_make_the_configuration_and_steps_are_told(called, tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["train", "foresight", "--config", "smoke", "--set", "batch=4", "--out", str(out)]) == 0
    assert called == [(NAMED["smoke"].replace(batch=4), False)]
    printed = capsys.readouterr()
    assert printed.out == f"4 updates, 640 samples, 9 s\nwrote {out / 'final.safetensors'}\nwrote {out / 'log.jsonl'}\n"
    assert printed.err.splitlines() == [
        "routes 1 of 1: 16 of lawnmower",
        "update 1 of 8, 2 s: loss 0.500",
        "update 4: RMSE 0.1000, fitted 0.1200, belief 0.1600; NLL -1.200, fitted -1.000",
    ]


def test_an_interrupted_run_says_how_to_go_on(called, tmp_path, capsys):
    assert main(["train", "foresight", "--set", "seed=13", "--resume", "--out", str(tmp_path)]) == 130
    assert called[0][1] and "interrupted after update 4; --resume goes on from it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        (["--config", "paper"], "--config paper: no such configuration; there are default, smoke"),
        (["--set", "batches=4"], "batches"),
        (["--set", "planners=gipsy"], "gipsy is none of receding-horizon"),
    ],
)
def test_a_configuration_that_does_not_fit(called, tmp_path, capsys, flags, text):
    assert main(["train", "foresight", *flags, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert text in error and len(error.splitlines()) == 1 and not called
