"""Training on several machines: who takes part, and arrays that move between one host and all of them."""

import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import multihost_utils

from maipp.devices import missions_devices
from maipp.errors import InputError, one_line

PyTree = Any
T = TypeVar("T")

# Room for the text of an error: `InputError` keeps it to 1000 characters, of at most 4 bytes each.
_TEXT_BYTES = 4096


class Hosts(NamedTuple):
    """The processes of one training run, seen from one of them."""

    devices: tuple[Any, ...]  # jax.Device of all processes, in the order that the shards are split over them
    process: int = 0  # this one; process 0 writes the files
    processes: int = 1


def join_hosts(
    *,
    coordinator: str | None = None,
    process_id: int | None = None,
    processes: int | None = None,
    environment: Mapping[str, str] = os.environ,
) -> int:
    """Connect to the other processes of the run, if there are any, and give their number; before JAX is used.

    `coordinator` is host:port of process 0; all three are needed, or none: then a job step of several SLURM tasks is
    recognised by itself. Raises InputError for flags that do not fit together, and where the others cannot be joined.
    """
    flags = {"--coordinator": coordinator, "--process-id": process_id, "--processes": processes}
    missing = [flag for flag, value in flags.items() if value is None]
    if 0 < len(missing) < len(flags):
        raise InputError(f"{missing[0]}: missing; give --coordinator, --process-id and --processes together")
    if not missing:
        _check(str(coordinator), int(process_id or 0), int(processes or 0))
    # srun sets it for each step; sbatch alone starts one process, whatever the number of tasks it has reserved.
    tasks = int(environment.get("SLURM_STEP_NUM_TASKS", "1"))
    slurm = bool(missing) and tasks > 1
    together = tasks if slurm else processes or 1
    if together > 1:
        jax.config.update("jax_cpu_collectives_implementation", "gloo")  # the only one that needs no MPI
        try:
            if slurm:
                jax.distributed.initialize(cluster_detection_method="slurm")
            else:
                jax.distributed.initialize(coordinator, processes, process_id)
        except (RuntimeError, ValueError) as error:
            where = "under SLURM" if slurm else f"at {coordinator}"
            raise InputError(f"cannot join the other processes {where}: {str(error).partition(chr(10))[0]}") from None
    return together


def _check(coordinator: str, process_id: int, processes: int) -> None:
    host, colon, port = coordinator.rpartition(":")
    if not (host and colon and port.isdigit() and 0 < int(port) < 65536):
        raise InputError(f"--coordinator {coordinator}: give host:port of process 0, such as node1:12345")
    if processes < 1:
        raise InputError(f"--processes {processes}: give a whole number >= 1")
    if not 0 <= process_id < processes:
        raise InputError(f"--process-id {process_id}: give 0 to {processes - 1} for --processes {processes}")


def hosts_of(shards: int) -> Hosts:
    """The processes that this one is connected to, with as many devices of each as the shards divide by.

    Raises InputError where the shards do not split over the processes.
    """
    processes = jax.process_count()
    if processes == 1:
        local = missions_devices()
        count = max(n for n in range(1, len(local) + 1) if shards % n == 0)
        return Hosts(tuple(local[:count]))
    if shards % processes:
        raise InputError(f"training: shards: {shards} do not split over {processes} processes; give a multiple of them")
    of_process = [[d for d in jax.devices() if d.process_index == p] for p in range(processes)]
    least = min(map(len, of_process))
    count = max(n for n in range(1, least + 1) if shards % (n * processes) == 0)
    devices = tuple(device for each in of_process for device in each[:count])
    return Hosts(devices, jax.process_index(), processes)


def to_host(tree: PyTree) -> PyTree:
    """The arrays of a pytree as NumPy arrays, whole on every process; random keys as their data.

    Where arrays are split over processes, all processes must call it together.
    """
    return jax.tree.map(_to_host, tree)


def _to_host(leaf: jax.Array) -> np.ndarray:
    data = jax.random.key_data(leaf) if _is_key(leaf) else leaf
    if data.is_fully_addressable or data.is_fully_replicated:
        return np.array(data)  # a copy: a view of a buffer that the next update donates would not hold
    return np.array(multihost_utils.process_allgather(data, tiled=True))


def from_host(arrays: PyTree, like: PyTree) -> PyTree:
    """The arrays of `to_host` on the devices and as the kind of key that `like` has; the inverse of `to_host`."""
    return jax.tree.map(_from_host, arrays, like)


def _from_host(array: np.ndarray, like: jax.Array) -> jax.Array:
    # A key's data has trailing axes that the key has not; a sharding of leading axes serves both.
    if like.is_fully_addressable:
        data = jax.device_put(array, like.sharding)
    else:
        data = jax.make_array_from_callback(array.shape, like.sharding, lambda index: array[index])
    return jax.random.wrap_key_data(data, impl=jax.random.key_impl(like)) if _is_key(like) else data


def _is_key(leaf: jax.Array) -> bool:
    return jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def from_first(tree: PyTree, processes: int) -> PyTree:
    """What process 0 has, on every process: NumPy arrays of the same shapes; all processes must call it together."""
    return tree if processes == 1 else jax.tree.map(np.asarray, multihost_utils.broadcast_one_to_all(tree))


def any_of(flag: bool, processes: int) -> bool:
    """Whether the flag is set on any process; all processes must call it together."""
    if processes == 1:
        return flag
    return bool(np.any(multihost_utils.process_allgather(np.asarray(flag))))


def all_or_none(action: Callable[[], T], processes: int) -> T:
    """What the action gives, once it went well on every process; all processes must call it together.

    For whatever can fail on one process alone, such as reading a file: the others would wait for it in the next
    computation that they share. Raises InputError everywhere, with what was wrong on the first process where it failed;
    there an error that is not an InputError is raised as it is.
    """
    if processes == 1:
        return action()
    failure: Exception | None = None
    result: Any = None
    try:
        result = action()
    except Exception as error:  # the others have to end, whatever it is
        failure = error
    texts = np.asarray(multihost_utils.process_allgather(_encoded(failure)))
    if failure is not None and not isinstance(failure, InputError):
        raise failure
    for process, text in enumerate(texts):
        if text[0]:
            told = bytes(text[1:]).rstrip(bytes(1)).decode()
            raise InputError(f"process {process}: {told}") from failure
    return result


def _encoded(failure: Exception | None) -> np.ndarray:
    """An error as bytes of a fixed number: whether there is one, then its text."""
    text = np.zeros(1 + _TEXT_BYTES, np.uint8)
    if failure is not None:
        told = str(failure) if isinstance(failure, InputError) else f"{type(failure).__name__}: {failure}"
        line = one_line(told).encode()
        text[0], text[1 : 1 + len(line)] = 1, np.frombuffer(line, np.uint8)
    return text
