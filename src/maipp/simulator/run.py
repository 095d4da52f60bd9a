"""Run any planner on a batch of missions: one compiled loop, sharded over the local devices."""

import math
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec

from maipp.devices import missions_devices
from maipp.errors import InputError
from maipp.scenario import Scenario
from maipp.simulator.decision import Planner
from maipp.simulator.engine import step
from maipp.simulator.mission import Mission
from maipp.simulator.state import State, reset
from maipp.typing import Array, Int, Key, Keys

# Missions an accelerator steps together; a CPU core takes `Planner.missions_per_core`.
ACCELERATOR_CHUNK = 4096


def batch_size(missions: Mission) -> int:
    """Number of missions in a batch."""
    return missions.start.shape[0]


def chunk_size(planner: Planner) -> int:
    """Missions that one device steps together, at most."""
    return planner.missions_per_core if jax.default_backend() == "cpu" else ACCELERATOR_CHUNK


def _run_chunk(scenario: Scenario, planner: Planner, missions: Mission, keys: Keys) -> State:
    """Final states of missions stepped together until the last has stopped."""
    state = jax.vmap(partial(reset, scenario, planner))(missions)
    advance = jax.vmap(partial(step, scenario, planner))
    return lax.while_loop(lambda state: jnp.any(state.active), lambda state: advance(missions, state, keys), state)


@eqx.filter_jit
def _run_sharded(
    scenario: Scenario, planner: Planner, missions: Mission, key: Key, first: Int[Array, ""], devices: int, chunk: int
) -> State:
    """Final states; the batch is padded with its last mission to a multiple of devices * chunk."""
    arrays, static = eqx.partition(planner, eqx.is_array)
    count = batch_size(missions)
    padded = math.ceil(count / (devices * chunk)) * devices * chunk
    index = jnp.minimum(jnp.arange(padded), count - 1)
    keys = jax.vmap(partial(jax.random.fold_in, key))(first + index)

    def per_device(arrays: Planner, missions: Mission, keys: Keys) -> State:
        local = eqx.combine(arrays, static)
        chunked = jax.tree.map(lambda a: a.reshape(-1, chunk, *a.shape[1:]), (missions, keys))
        final = lax.map(lambda pair: _run_chunk(scenario, local, *pair), chunked)
        return jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), final)

    mesh = Mesh(np.asarray(missions_devices()[:devices]), ("missions",))
    split, whole = PartitionSpec("missions"), PartitionSpec()
    sharded = jax.shard_map(per_device, mesh=mesh, in_specs=(whole, split, split), out_specs=split, check_vma=False)
    final = sharded(arrays, jax.tree.map(lambda a: a[index], missions), keys)
    return jax.tree.map(lambda a: a[:count], final)


def refuse_to_cross(scenario: Scenario, planner: Planner) -> None:
    """Raise InputError for obstacles that the planner does not avoid."""
    if scenario.obstacles and not planner.avoids_obstacles:
        raise InputError(
            f"{type(planner).__name__}: this planner would cross the scenario's {len(scenario.obstacles)} obstacles; "
            "use one that avoids them"
        )


def run_missions(scenario: Scenario, planner: Planner, missions: Mission, key: Key, *, first: int = 0) -> State:
    """Final states of a batch of missions (leading axis b on every array).

    Mission i draws its randomness from `fold_in(key, first + i)`, so a mission's record does not depend on the batch
    it ran in, up to floating-point rounding of batched matrix products. `first` is the number of the batch's first
    mission where a longer batch runs in parts. Raises InputError for obstacles that the planner does not avoid.
    """
    refuse_to_cross(scenario, planner)
    count = batch_size(missions)
    devices = min(len(missions_devices()), count)
    # Chunks of equal size: a last one that is all but empty would take as long as the others.
    each = math.ceil(count / devices)
    chunk = math.ceil(each / math.ceil(each / chunk_size(planner)))
    return _run_sharded(scenario, planner, missions, key, jnp.asarray(first), devices, chunk)
