"""Run any planner on a batch of missions: one compiled loop, sharded over the local devices."""

import math
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec

from maipp.devices import missions_devices
from maipp.engine.advance import advance
from maipp.engine.decision import Planner
from maipp.engine.mission import Mission
from maipp.engine.observe import turn
from maipp.engine.rows import pick
from maipp.engine.state import State, reset
from maipp.errors import InputError
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Int, Key, Keys

# Missions an accelerator steps together; a CPU core takes `Planner.missions_per_core`.
ACCELERATOR_LANES = 4096


def batch_size(missions: Mission) -> int:
    """Number of missions in a batch."""
    return missions.start.shape[0]


def lanes_at_most(planner: Planner) -> int:
    """Missions that one device steps together, at most."""
    return planner.missions_per_core if jax.default_backend() == "cpu" else ACCELERATOR_LANES


def step(scenario: Scenario, planner: Planner, mission: Mission, state: State, key: Key) -> State:
    """One event: the due agent hears, observes, decides, sets off. A finished mission is returned unchanged."""
    state, agent, observation = turn(scenario, mission, state)
    memory = jax.tree.map(lambda a: pick(a, agent), state.memory)
    decision = planner.decide(jax.random.fold_in(key, state.events), observation, memory)
    return advance(scenario, planner, mission, state, agent, decision)


class _Lanes(NamedTuple):
    """The missions that a device steps together, and those it is done with."""

    number: Int[Array, " l"]  # which of the device's n missions each lane has; n where none is left for it
    new: Bool[Array, " l"]  # lanes whose mission has not begun
    state: State  # leading axis l
    waiting: Int[Array, ""]  # the first mission that no lane has taken up
    final: State  # leading axis n


def _run_lanes(scenario: Scenario, planner: Planner, missions: Mission, keys: Keys, lanes: int) -> State:
    """Final states of n missions, `lanes` of them stepped together; a lane whose mission has ended takes the next.

    So no mission waits for the longest of those that it began with; only the last ones do.
    """
    count = batch_size(missions)
    begin = partial(reset, scenario, planner)
    go = jax.vmap(partial(step, scenario, planner))
    # Taking up missions copies the worlds of all lanes: too much for every step of an accelerator's thousands of lanes.
    enough = max(1, lanes // 16)

    def begun(new: Bool[Array, ""], mission: Mission, state: State) -> State:
        return jax.tree.map(partial(jnp.where, new), begin(mission), state)

    def travel(lane: _Lanes) -> _Lanes:
        """Begin what is new, and step until missions have ended: enough of them, or all where none waits."""
        mission, key = jax.tree.map(lambda a: a[jnp.minimum(lane.number, count - 1)], (missions, keys))
        state = jax.vmap(begun)(lane.new, mission, lane.state)

        def over(state: State) -> Bool[Array, " l"]:
            return (lane.number < count) & ~jnp.any(state.active, axis=-1)

        def travelling(state: State) -> Bool[Array, ""]:
            relief = (lane.waiting < count) & (jnp.sum(over(state)) >= enough)
            return jnp.any(state.active) & ~relief

        state = lax.while_loop(travelling, lambda state: go(mission, state, key), state)
        return put_away(lane._replace(state=state), over(state))

    def put_away(lane: _Lanes, over: Bool[Array, " l"]) -> _Lanes:
        """Keep the states of the missions that are over, and give their lanes the next ones."""
        slot = jnp.where(over, lane.number, count)  # what is written beyond the last is dropped
        final = jax.tree.map(lambda all, one: all.at[slot].set(one, mode="drop"), lane.final, lane.state)
        number = jnp.where(over, jnp.minimum(lane.waiting + jnp.cumsum(over) - 1, count), lane.number)
        waiting = jnp.minimum(lane.waiting + jnp.sum(over), count)
        return _Lanes(number, over & (number < count), lane.state, waiting, final)

    state = jax.vmap(begin)(jax.tree.map(lambda a: a[:lanes], missions))
    final = jax.tree.map(lambda a: jnp.zeros((count, *a.shape[1:]), a.dtype), state)
    lane = _Lanes(jnp.arange(lanes), jnp.zeros(lanes, bool), state, jnp.asarray(lanes), final)
    return lax.while_loop(lambda lane: jnp.any(lane.number < count), travel, lane).final


@eqx.filter_jit
def _run_sharded(
    scenario: Scenario, planner: Planner, missions: Mission, key: Key, first: Int[Array, ""], devices: int, lanes: int
) -> State:
    """Final states; the batch is padded with its last mission to a multiple of the devices."""
    arrays, static = eqx.partition(planner, eqx.is_array)
    count = batch_size(missions)
    padded = math.ceil(count / devices) * devices
    index = jnp.minimum(jnp.arange(padded), count - 1)
    keys = jax.vmap(partial(jax.random.fold_in, key))(first + index)

    def per_device(arrays: Planner, missions: Mission, keys: Keys) -> State:
        return _run_lanes(scenario, eqx.combine(arrays, static), missions, keys, lanes)

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
    # No more lanes than it takes: where all missions are equally long, a last round with empty lanes costs as much.
    each = math.ceil(count / devices)
    lanes = math.ceil(each / math.ceil(each / lanes_at_most(planner)))
    return _run_sharded(scenario, planner, missions, key, jnp.asarray(first), devices, lanes)
