"""Several processes train as one; flags that make no sense are refused."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from safetensors.numpy import load

from maipp.errors import InputError
from maipp.policy import load_weights
from maipp.training import hosts as module
from maipp.training.checkpoint import checkpoints
from maipp.training.hosts import from_host, hosts_of, join_hosts, to_host
from maipp.training.journal import read_log

SCRIPT = Path(__file__).with_name("tiny_run.py")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return str(found.getsockname()[1])


def run_tiny(*arguments):
    """Run the script once for each tuple of arguments, at the same time."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    environment.pop("JAX_NUM_CPU_DEVICES", None)  # one device for each process
    running = [
        subprocess.Popen(
            [sys.executable, str(SCRIPT), *map(str, each)],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for each in arguments
    ]
    try:
        told = [process.communicate(timeout=400)[0] for process in running]
    finally:
        for process in running:
            process.kill()
    assert [process.returncode for process in running] == [0] * len(running), "\n".join(told)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two folders: 4 updates of the real learner without a break, and the first 2 of them."""
    folder = tmp_path_factory.mktemp("runs")
    run_tiny((folder / "straight",))
    run_tiny((folder / "half", "--stop", 2))
    assert [path.name for path in checkpoints(folder / "half" / "checkpoints")] == ["000000", "000002"]
    return folder


@pytest.mark.slow
def test_resumed_the_learner_ends_with_the_same_bytes(runs, tmp_path):
    resumed = shutil.copytree(runs / "half", tmp_path / "resumed")
    run_tiny((resumed,))
    states = []
    for out in (runs / "straight", resumed):
        (tensors,) = (out / "checkpoints" / "000004").glob("*.safetensors")
        states.append((tensors.read_bytes(), (out / "final.safetensors").read_bytes()))
    assert states[0] == states[1]


@pytest.mark.slow
def test_two_processes_go_on_from_one_and_get_its_weights(runs, tmp_path):
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
        join_hosts(2, **flags, environment={})


@pytest.mark.parametrize(
    ("environment", "joins"),
    [({}, False), ({"SLURM_NTASKS": "2"}, False), ({"SLURM_STEP_NUM_TASKS": "1"}, False)]
    + [({"SLURM_STEP_NUM_TASKS": "2"}, True)],
)
def test_a_step_of_several_slurm_tasks_is_joined(environment, joins, monkeypatch):
    calls = []
    monkeypatch.setattr(jax.distributed, "initialize", lambda *args, **kwargs: calls.append((args, kwargs)))
    monkeypatch.setattr(jax.config, "update", lambda *args: calls.append(args))
    assert join_hosts(2, environment=environment).processes == 1  # nobody was really joined
    gloo, slurm = ("jax_cpu_collectives_implementation", "gloo"), ((), {"cluster_detection_method": "slurm"})
    assert calls == ([gloo, slurm] if joins else [])


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
