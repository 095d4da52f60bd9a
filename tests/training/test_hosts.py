"""Several processes train as one; flags that make no sense are refused."""

import re
import shutil
import socket
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from safetensors.numpy import load

from maipp.errors import InputError
from maipp.policy import load_weights
from maipp.training import hosts as module
from maipp.training.checkpoint import checkpoints, save_checkpoint
from maipp.training.config_io import config_to_dict, dump_config
from maipp.training.hosts import from_host, hosts_of, join_hosts, to_host
from maipp.training.training_log import read_log

SCRIPT = Path(__file__).with_name("tiny_run.py")
FAKE_HOSTS = Path(__file__).with_name("fake_hosts.py")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return str(found.getsockname()[1])


@pytest.fixture(scope="session")
def run_tiny(run_all):
    """Run the script once for each tuple of arguments, at the same time."""

    def run(*arguments):
        codes, told = run_all([(SCRIPT, *each) for each in arguments], 400)
        assert codes == [0] * len(arguments), "\n".join(told)

    return run


@pytest.fixture(scope="module")
def runs(run_tiny, tmp_path_factory):
    """Two folders: 4 updates of the real learner without a break, and the first 2 of them."""
    folder = tmp_path_factory.mktemp("runs")
    run_tiny((folder / "straight", "--half", folder / "half"))
    assert [path.name for path in checkpoints(folder / "half" / "checkpoints")] == ["000000", "000002"]
    return folder


@pytest.mark.slow
def test_resumed_the_learner_ends_with_the_same_bytes(runs, run_tiny, tmp_path):
    resumed = shutil.copytree(runs / "half", tmp_path / "resumed")
    run_tiny((resumed,))
    states = []
    for out in (runs / "straight", resumed):
        (tensors,) = (out / "checkpoints" / "000004").glob("*.safetensors")
        states.append((tensors.read_bytes(), (out / "final.safetensors").read_bytes()))
    assert states[0] == states[1]


@pytest.mark.slow
def test_two_processes_go_on_from_one_and_get_its_weights(runs, run_tiny, tmp_path):
    two = shutil.copytree(runs / "half", tmp_path / "two")
    port = free_port()
    run_tiny(*[(two, "--port", port, "--process", process) for process in (0, 1)])
    straight = runs / "straight"
    weights = [jax.tree.leaves(load_weights(out / "final.safetensors")[0]) for out in (straight, two)]
    (half,) = (runs / "half" / "checkpoints" / "000002").glob("*.safetensors")
    before = [tensor for name, tensor in load(half.read_bytes()).items() if name.startswith("network.")]
    for left, right in zip(*weights, strict=True):
        np.testing.assert_allclose(left, right, atol=1e-5)
    moved = [abs(np.linalg.norm(a) - np.linalg.norm(b)) for a, b in zip(before, weights[0], strict=False)]
    assert max(moved) > 1e-3  # far more than the tolerance
    losses = [[row["loss"] for row in read_log(out) if "loss" in row] for out in (straight, two)]
    assert len(losses[0]) == 4
    np.testing.assert_allclose(losses[0], losses[1], atol=1e-4)


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def checkpoint_of_another_version(out, fake):
    """A folder whose checkpoint is of another state than this version's."""
    save_checkpoint(out / "checkpoints", 1, {"w": np.zeros(3)}, {"config": config_to_dict(fake.fake_config(2))})


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("folder", r"process 0: .*zero: holds a training run already; --resume goes on with it"),
        ("config", r"process 1: .*none\.yaml: "),
        ("file", r"process 1: .*one: is a file; give a folder"),
        ("learner", r"process 1: own\.safetensors: no such file"),
        slow("checkpoint", r"process 0: .*000001: .*: not in both the checkpoint and this version's state"),
        slow("evaluation", r"process 0: MemoryError: no room for the worlds"),
        slow(None, ""),
    ],
)
def test_a_process_that_cannot_go_on_ends_all_of_them(fault, says, fake, run_all, tmp_path):
    """Each with exit code 2 and one line that says what was wrong where, and none once a wait for another times out.

    An error that is nobody's input has its traceback where it was raised.
    """
    folders = [tmp_path / "zero", tmp_path / "one"]  # as on two machines that share no disk
    files = [tmp_path / "given.yaml"] * 2
    files[0].write_text(dump_config(fake.fake_config(2)))
    if fault == "folder":
        folders[0].mkdir()
        (folders[0] / "log.jsonl").write_text("")
    elif fault == "config":
        files[1] = tmp_path / "none.yaml"
    elif fault == "file":
        folders[1].write_text("")
    elif fault == "checkpoint":
        checkpoint_of_another_version(folders[0], fake)
    port, resume = free_port(), ["--resume"] if fault == "checkpoint" else []
    commands = [
        (FAKE_HOSTS, fault, port, process, "--out", folders[process], "--config", files[process], *resume)
        for process in (0, 1)
    ]
    codes, told = run_all(commands, 400)
    ends = {None: [0, 0], "evaluation": [1, 2]}
    assert codes == ends.get(fault, [2, 2]), "\n".join(told)
    for code, text in zip(codes, told, strict=True):
        lines = [line for line in text.splitlines() if line.startswith("error: ")]
        assert len(lines) == (code == 2) and ("Traceback" in text) == (code == 1), text
        assert all(re.match(f"error: {says}", line) for line in lines), text


def test_arrays_come_back_from_the_host_as_they_were():
    mesh = jax.sharding.Mesh(np.asarray(jax.local_devices()), ("devices",))
    split = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("devices"))
    state = {
        "keys": jax.device_put(jax.random.split(jax.random.key(3), 2), split),
        "x": jax.device_put(np.arange(8.0, dtype=np.float32).reshape(2, 4), split),
        "n": jax.numpy.zeros((), jax.numpy.int32),
    }
    there = to_host(state)
    back = from_host(there, state)
    assert all(
        a.sharding == b.sharding and a.dtype == b.dtype
        for a, b in zip(*map(jax.tree.leaves, (state, back)), strict=True)
    )
    assert all((a == b).all() for a, b in zip(*map(jax.tree.leaves, (there, to_host(back))), strict=True))


def test_the_host_copy_outlives_a_donated_buffer():
    array = jax.numpy.arange(5.0)
    there = to_host(array)
    assert there.flags.owndata


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        ({"coordinator": "node1:1234"}, "--process-id: missing; give --coordinator, --process-id and --processes"),
        ({"process_id": 0, "processes": 2}, "--coordinator: missing"),
        ({"coordinator": "node1", "process_id": 0, "processes": 2}, "--coordinator node1: give host:port"),
        ({"coordinator": "node1:0", "process_id": 0, "processes": 2}, "--coordinator node1:0: give host:port"),
        ({"coordinator": "node1:1234", "process_id": 2, "processes": 2}, "--process-id 2: give 0 to 1"),
        ({"coordinator": "node1:1234", "process_id": 0, "processes": 0}, "--processes 0: give a whole number >= 1"),
    ],
)
def test_flags_that_do_not_fit_together(flags, says):
    with pytest.raises(InputError, match=says):
        join_hosts(**flags, environment={})


@pytest.mark.parametrize(
    ("environment", "tasks"),
    [({}, 1), ({"SLURM_NTASKS": "2"}, 1), ({"SLURM_STEP_NUM_TASKS": "1"}, 1), ({"SLURM_STEP_NUM_TASKS": "2"}, 2)],
)
def test_a_step_of_several_slurm_tasks_is_joined(environment, tasks, monkeypatch):
    calls = []
    monkeypatch.setattr(jax.distributed, "initialize", lambda *args, **kwargs: calls.append((args, kwargs)))
    monkeypatch.setattr(jax.config, "update", lambda *args: calls.append(args))
    assert join_hosts(environment=environment) == tasks
    gloo, slurm = ("jax_cpu_collectives_implementation", "gloo"), ((), {"cluster_detection_method": "slurm"})
    assert calls == ([gloo, slurm] if tasks > 1 else [])


@pytest.mark.parametrize(("shards", "used"), [(1, 1), (2, 2), (3, 1), (4, 2)])
def test_one_process_uses_as_many_devices_as_divide_the_shards(shards, used, monkeypatch):
    monkeypatch.setattr(module, "missions_devices", lambda: ["a", "b"])
    assert hosts_of(shards).devices == ("a", "b")[:used]


@pytest.mark.parametrize(("shards", "used"), [(2, "00 10"), (4, "00 01 10 11"), (6, "00 10"), (3, None)])
def test_every_process_gives_as_many_devices(shards, used, monkeypatch):
    devices = [SimpleNamespace(process_index=p, name=f"{p}{d}") for p, d in ((0, 0), (0, 1), (1, 0), (1, 1), (1, 2))]
    monkeypatch.setattr(jax, "process_count", lambda: 2)
    monkeypatch.setattr(jax, "process_index", lambda: 1)
    monkeypatch.setattr(jax, "devices", lambda: devices)
    if used is None:
        with pytest.raises(InputError, match="shards: 3 do not split over 2 processes"):
            hosts_of(shards)
    else:
        hosts = hosts_of(shards)
        assert ([d.name for d in hosts.devices], hosts.process, hosts.processes) == (used.split(), 1, 2)
