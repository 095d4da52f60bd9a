"""The loop: what it leaves behind, and that a run interrupted anyhow ends as one that never was."""

import json
import os
import random
import signal
import sys
import types
from pathlib import Path

import jax
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.policy import load_weights
from maipp.training import train as loop
from maipp.training.checkpoint import checkpoints, load_latest
from maipp.training.hosts import to_host
from maipp.training.train import DivergedError, train
from maipp.training.training_log import read_log

FAKE_RUN = Path(__file__).with_name("fake_run.py")


@pytest.fixture(autouse=True)
def fake_worlds(fake, monkeypatch):
    monkeypatch.setattr(loop, "HeldOutWorlds", fake.FakeWorlds)


def final_state(out, fake):
    loaded = load_latest(out / "checkpoints", to_host(fake.FakeLearner().initial()))
    assert loaded is not None
    return loaded[1]["update"], [leaf.tobytes() for leaf in jax.tree.leaves(loaded[0])]


def without_times(rows):
    return [{k: v for k, v in row.items() if k not in ("wall_s", "update_s", "transitions_per_s")} for row in rows]


def test_a_run_leaves_weights_log_checkpoints_and_a_curve(tmp_path, fake, monkeypatch):
    monkeypatch.setitem(sys.modules, "tensorboardX", None)  # as where it is not installed
    steps = []
    about = {"machine": {"cpu": "abacus"}}
    result = train(
        fake.fake_config(5), tmp_path / "run", learner=fake.FakeLearner(), progress=steps.append, about=about
    )
    out = tmp_path / "run"
    assert {path.name for path in out.iterdir()} == {
        "best.json", "best.safetensors", "checkpoints", "config.yaml", "final.json", "final.safetensors",
        "learning_curve.png", "log.jsonl",
    }  # fmt: skip
    assert not result.interrupted and result.record.update == 5 and result.checkpoint == out / "checkpoints" / "000005"
    assert [path.name for path in checkpoints(out / "checkpoints")] == ["000004", "000005"]
    rows = read_log(out)
    assert [row["update"] for row in rows if "evaluation" not in row] == [1, 2, 3, 4, 5]
    evaluations = {row["update"]: row["evaluation"]["trace"] for row in rows if "evaluation" in row}
    assert list(evaluations) == [0, 2, 4, 5]
    assert [row["transitions"] for row in rows if row["update"] == 5] == [40, 40]  # 2 shards x 2 missions x 2 events
    assert [step.update for step in steps] == [0, 1, 2, 2, 3, 4, 4, 5, 5]
    network, card = load_weights(out / "best.safetensors")
    assert card["evaluation"]["trace"] == min(evaluations.values()) == fake.FakeWorlds(None).evaluate(network).trace
    assert result.record.best is not None and card["updates"] == result.record.best["update"]
    card = load_weights(out / "final.safetensors")[1]
    assert (card["updates"], card["transitions"], card["licence"], card["machine"]) == (
        5,
        40,
        "Apache-2.0",
        about["machine"],
    )
    assert card["training"]["evaluate_every"] == 2 and card["evaluation"]["trace"] == evaluations[5]
    assert (out / "learning_curve.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_and_resumed_a_run_ends_with_the_same_bytes(tmp_path, fake, number):
    config = fake.fake_config(6)
    before = signal.getsignal(number)
    train(config, tmp_path / "straight", learner=fake.FakeLearner())

    def interrupt(step):
        if step.update == 3:
            os.kill(os.getpid(), number)

    first = train(config, tmp_path / "resumed", learner=fake.FakeLearner(), progress=interrupt)
    assert first.interrupted and first.record.update == 3 and first.checkpoint.is_dir()
    assert not (tmp_path / "resumed" / "final.safetensors").exists() and signal.getsignal(number) is before
    second = train(config, tmp_path / "resumed", learner=fake.FakeLearner(), resume=True)
    assert not second.interrupted and second.record.wall_s > first.record.wall_s
    assert final_state(tmp_path / "straight", fake) == final_state(tmp_path / "resumed", fake)
    logs = [without_times(read_log(tmp_path / name)) for name in ("straight", "resumed")]
    assert logs[0] == logs[1]
    for name in ("best.safetensors", "final.safetensors"):
        assert (tmp_path / "straight" / name).read_bytes() == (tmp_path / "resumed" / name).read_bytes()


def test_a_finished_run_stays_as_it_is(tmp_path, fake):
    config = fake.fake_config(2)
    for resume in (False, True):
        result = train(config, tmp_path, learner=fake.FakeLearner(), resume=resume)
        state = final_state(tmp_path, fake)
        assert not result.interrupted and state[0] == 2
    assert [row["update"] for row in read_log(tmp_path)] == [0, 1, 2, 2]


@pytest.mark.slow
def test_killed_again_and_again_a_run_still_ends_with_the_same_bytes(tmp_path, fake, run_all):
    updates, draw = 6, random.Random(5)
    train(fake.fake_config(updates), tmp_path / "straight", learner=fake.FakeLearner())
    out = tmp_path / "killed"

    def live(*kill):
        (code,), told = run_all([(FAKE_RUN, out, updates, *kill)], 120)
        return code, told

    lives = [live(draw.randint(3, 70)) for _ in range(5)]
    assert {code for code, _ in lives} <= {-signal.SIGKILL, 0}, lives
    assert sum(code != 0 for code, _ in lives) >= 3
    code, told = live()
    assert code == 0, told
    assert final_state(tmp_path / "straight", fake) == final_state(out, fake)
    logs = [without_times(read_log(tmp_path / name)) for name in ("straight", "killed")]
    assert logs[0] == logs[1]
    assert (tmp_path / "straight" / "final.safetensors").read_bytes() == (out / "final.safetensors").read_bytes()
    assert {path.name for path in out.iterdir()} - {".", ".."} >= {"best.safetensors", "learning_curve.png"}


@pytest.mark.parametrize(("wrong", "says"), [({"breaks": 4}, "the loss is nan"), ({"spoils": 4}, "a weight is not")])
def test_divergence_names_the_last_good_checkpoint(tmp_path, fake, wrong, says):
    with pytest.raises(DivergedError, match=f"diverged in update 4: {says}") as caught:
        train(fake.fake_config(6), tmp_path, learner=fake.FakeLearner(**wrong))
    assert str(tmp_path / "checkpoints" / "000003") in str(caught.value) and "\n" not in str(caught.value)
    loaded = load_latest(tmp_path / "checkpoints", to_host(fake.FakeLearner().initial()))
    assert loaded is not None and loaded[1]["update"] == 3
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(loaded[0]))
    assert [row["update"] for row in read_log(tmp_path) if "evaluation" not in row] == [1, 2, 3]


def test_a_folder_that_holds_a_run_is_not_overwritten(tmp_path, fake):
    train(fake.fake_config(2), tmp_path, learner=fake.FakeLearner())
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"holds a training run already \(update 2 of 2\); --resume"):
        train(fake.fake_config(2), tmp_path, learner=fake.FakeLearner())
    with pytest.raises(InputError, match="updates 2, this one 3"):
        train(fake.fake_config(3), tmp_path, learner=fake.FakeLearner(), resume=True)
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        train(fake.fake_config(2), tmp_path / "file", learner=fake.FakeLearner())


def test_tensorboard_gets_the_numbers_where_it_is_installed(tmp_path, fake, monkeypatch):
    written = []

    class Writer:
        def __init__(self, folder, purge_step):
            written.append((folder, purge_step))

        def add_scalar(self, name, value, step):
            written.append((name, value, step))

        def close(self):
            written.append("closed")

    monkeypatch.setitem(sys.modules, "tensorboardX", types.SimpleNamespace(SummaryWriter=Writer))
    train(fake.fake_config(1), tmp_path, learner=fake.FakeLearner())
    assert written[0] == (str(tmp_path / "tensorboard"), 1) and written[-1] == "closed"
    assert {("final_trace", 100.0, 1), ("transitions", 8, 1)} <= set(written[1:-1])
    assert "evaluation/trace" in {entry[0] for entry in written[1:-1]}


def test_the_log_is_json_without_nan(tmp_path, fake):
    train(fake.fake_config(2), tmp_path, learner=fake.FakeLearner())
    for line in (tmp_path / "log.jsonl").read_text().splitlines():
        json.loads(line, parse_constant=lambda name: pytest.fail(name))
