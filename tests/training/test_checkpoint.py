"""A checkpoint is whole or not there, and comes back with the very bytes that went in."""

import json
import os
import signal

import jax
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.training import checkpoint
from maipp.training.checkpoint import checkpoints, latest_card, load_latest, save_checkpoint

ABOUT = {"config": {"seed": 3}, "note": "x"}


def arrays(value=1.0):
    return {
        "weights": [np.full((3, 4), value, np.float32), np.array(value, np.float64)],
        "keys": np.array([[1, 2], [3, 4]], np.uint32),
        "active": np.array([True, False]),
        "count": np.array(7, np.int32),
        "strided": np.arange(12.0, dtype=np.float32).reshape(3, 4).T,
    }


def same(left, right):
    pairs = zip(jax.tree.leaves(left), jax.tree.leaves(right), strict=True)
    return all(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in pairs)


def test_what_goes_in_comes_out(tmp_path):
    path = save_checkpoint(tmp_path / "c", 12, arrays(np.pi), ABOUT)
    assert path == tmp_path / "c" / "000012"
    loaded = load_latest(tmp_path / "c", arrays(0.0))
    assert loaded is not None
    assert same(loaded[0], arrays(np.pi))
    assert loaded[1] | ABOUT == loaded[1] and loaded[1]["update"] == 12
    assert latest_card(tmp_path / "c") == loaded[1]


def test_the_last_two_are_kept(tmp_path):
    for update in (0, 9, 10, 1_000_000):
        save_checkpoint(tmp_path, update, arrays(update), ABOUT)
    assert [path.name for path in checkpoints(tmp_path)] == ["000010", "1000000"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["000010", "1000000"]
    loaded = load_latest(tmp_path, arrays())
    assert loaded is not None and same(loaded[0], arrays(1_000_000))


def test_none_is_none(tmp_path):
    assert load_latest(tmp_path / "missing", arrays()) is None and latest_card(tmp_path) is None


def test_large_states_are_split_into_small_files(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "FILE_BYTES", 4096)
    state = {f"w{i}": np.full(200, i, np.float32) for i in range(9)} | {"large": np.ones(5000, np.float32)}
    path = save_checkpoint(tmp_path, 1, state, ABOUT)
    sizes = sorted(file.stat().st_size for file in path.glob("*.safetensors"))
    assert len(sizes) > 3 and sizes[-1] > 20_000 and sizes[-2] <= 4096  # one array stays in one file
    loaded = load_latest(tmp_path, state)
    assert loaded is not None and all((loaded[0][name] == state[name]).all() for name in state)


@pytest.mark.parametrize("damage", ["truncate", "flip", "missing", "card", "empty card", "no card"])
def test_a_damaged_one_gives_way_to_the_one_before(tmp_path, damage):
    save_checkpoint(tmp_path, 1, arrays(1.0), ABOUT)
    last = save_checkpoint(tmp_path, 2, arrays(2.0), ABOUT)
    tensors, card = last / "state-00.safetensors", last / "checkpoint.json"
    if damage == "truncate":
        tensors.write_bytes(tensors.read_bytes()[:-5])
    elif damage == "flip":
        content = bytearray(tensors.read_bytes())
        content[-1] ^= 1
        tensors.write_bytes(bytes(content))
    elif damage == "missing":
        tensors.unlink()
    elif damage == "no card":
        card.unlink()
    else:
        card.write_text("" if damage == "empty card" else card.read_text()[:40])
    loaded = load_latest(tmp_path, arrays())
    assert loaded is not None and same(loaded[0], arrays(1.0))
    save_checkpoint(tmp_path, 2, arrays(2.0), ABOUT)  # the same run comes by again
    loaded = load_latest(tmp_path, arrays())
    assert loaded is not None and same(loaded[0], arrays(2.0))


def test_a_state_of_another_make_is_refused(tmp_path):
    path = save_checkpoint(tmp_path, 1, arrays(), ABOUT)
    with pytest.raises(InputError, match="extra"):
        load_latest(tmp_path, arrays() | {"extra": np.zeros(1)})
    with pytest.raises(InputError, match=r"count is int32\[\], this version's int64\[\]"):
        load_latest(tmp_path, arrays() | {"count": np.array(7, np.int64)})
    card = json.loads((path / "checkpoint.json").read_text())
    (path / "checkpoint.json").write_text(json.dumps(card | {"schema": "maipp.checkpoint/9"}))
    with pytest.raises(InputError, match="maipp.checkpoint/9"):
        load_latest(tmp_path, arrays())


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        save_checkpoint(tmp_path / "file", 1, arrays(), ABOUT)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a forked process")
def test_killed_before_any_operation_the_old_or_the_new_one_is_there(tmp_path, monkeypatch):
    """A child saves checkpoint 3 over 1 and 2, and dies before its n-th operation, for every n."""
    names = [(os, name) for name in ("fsync", "rename", "mkdir", "open", "unlink", "rmdir")]
    outcomes = []
    for n in range(1, 200):
        folder = tmp_path / str(n)
        for update in (1, 2):
            save_checkpoint(folder, update, arrays(update), ABOUT)
        child = os.fork()
        if child == 0:
            try:
                left = [n]

                def dying(operation, left=left):
                    def call(*args, **kwargs):
                        left[0] -= 1
                        if left[0] == 0:
                            os.kill(os.getpid(), signal.SIGKILL)
                        return operation(*args, **kwargs)

                    return call

                for module, name in names:
                    setattr(module, name, dying(getattr(module, name)))
                save_checkpoint(folder, 3, arrays(3.0), ABOUT)
            finally:
                os._exit(0)
        died = os.WIFSIGNALED(os.waitpid(child, 0)[1])
        loaded = load_latest(folder, arrays())
        assert loaded is not None and loaded[1]["update"] in (2, 3)
        assert same(loaded[0], arrays(float(loaded[1]["update"])))
        outcomes.append(loaded[1]["update"])
        save_checkpoint(folder, 3, arrays(3.0), ABOUT)  # whatever was left behind is no hindrance, and goes
        assert sorted(path.name for path in folder.iterdir()) == ["000002", "000003"]
        if not died:
            break
    assert len(outcomes) > 10 and outcomes == sorted(outcomes) and set(outcomes) == {2, 3}
    assert not died
