"""Run any planner on a batch of missions: one compiled loop of events, sharded over the local devices."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec

from maipp.devices import missions_devices
from maipp.engine.advance import advance
from maipp.engine.decide import ask
from maipp.engine.decision import Decision, Planner
from maipp.engine.mission import Mission
from maipp.engine.observe import begin_event
from maipp.engine.rows import pick
from maipp.engine.state import RECORD_FULL, State, reset, route_capacity, with_capacity
from maipp.errors import InputError
from maipp.kept import kept
from maipp.typing import Array, Bool, Float, Index, Int, Key, Keys

# Missions an accelerator steps together; a CPU core takes `Planner.missions_per_core`.
ACCELERATOR_LANES = 4096

# An agent whose route needs more room than this times the usual is stopped.
_MOST_ROOM = 4**4


class Events(NamedTuple):
    """The decisions of a batch of missions in their order; b missions, e events."""

    agent: Int[np.ndarray, "b e"]  # that decided
    counts: Bool[np.ndarray, "b e"]  # False where the mission had ended before
    time: Float[np.ndarray, "b e"]  # of the decision
    kept: Any  # (b, e, ...): what was kept of the message that was sent


def batch_size(missions: Mission) -> int:
    """Number of missions in a batch."""
    return missions.start.shape[0]


def lanes_at_most(planner: Planner) -> int:
    """Missions that one device steps together, at most."""
    return planner.missions_per_core if jax.default_backend() == "cpu" else ACCELERATOR_LANES


def due_decision(planner: Planner, mission: Mission, state: State, key: Key) -> tuple[State, Index, Decision]:
    """What the due agent decides: the state once it has heard the others, who it is, and its decision."""
    state, agent, observation = begin_event(mission, state)
    memory = jax.tree.map(lambda a: pick(a, agent), state.memory)
    return state, agent, ask(planner, mission, jax.random.fold_in(key, state.events), observation, memory)


def step(planner: Planner, mission: Mission, state: State, key: Key) -> State:
    """One event: the due agent hears, observes, decides, sets off. A finished mission is returned unchanged."""
    return advance(planner, mission, *due_decision(planner, mission, state, key))


Keep = Callable[[Any], Any]


class _EventLog(NamedTuple):
    """What events leave behind besides the state; e events."""

    agent: Int[Array, " e"]
    time: Float[Array, " e"]
    kept: Any


def _most_events(state: State) -> int:
    """Decisions that the record of the routes has room for, and everybody's last."""
    agents, vertices = state.route_time.shape[-2:]
    return agents * (vertices - 1) // (state.leg.shape[-2] - 1) + agents


def _empty_log(keep: Keep, state: State) -> _EventLog:
    """Room for every event."""
    events = _most_events(state)
    kept = jax.eval_shape(lambda messages: keep(jax.tree.map(lambda a: a[0], messages)), state.messages)
    return _EventLog(
        agent=jnp.zeros(events, jnp.int32),
        time=jnp.zeros(events, state.time.dtype),
        kept=jax.tree.map(lambda a: jnp.zeros((events, *a.shape), a.dtype), kept),
    )


def _logged(
    keep: Keep, planner: Planner, mission: Mission, state: State, key: Key, log: _EventLog
) -> tuple[State, _EventLog]:
    """One event, and the log with it."""
    running, number = state.active.any(), state.events
    heard, agent, decision = due_decision(planner, mission, state, key)
    after = advance(planner, mission, heard, agent, decision)
    kept = keep(jax.tree.map(lambda a: pick(a, agent), after.messages))

    def write(row: Array, value: Array) -> Array:
        return row.at[jnp.where(running, number, len(row))].set(value, mode="drop")

    new = _EventLog(agent, after.time, kept)
    return after, jax.tree.map(write, log, new)


_Pair = tuple[State, _EventLog | None]  # a mission in progress, and what it leaves behind


class _Lanes(NamedTuple):
    """The missions that a device steps together, and those it is done with."""

    number: Int[Array, " l"]  # which of the device's n missions each lane has; n where none is left for it
    new: Bool[Array, " l"]  # lanes whose mission has not begun
    state: Any  # State, and the log where there is one; leading axis l
    waiting: Int[Array, ""]  # the first mission that no lane has taken up
    final: Any  # leading axis n


def _run_lanes(
    planner: Planner, missions: Mission, begun: _Pair | None, keys: Keys, lanes: int, capacity: int, keep: Keep | None
) -> _Pair:
    """Final states of n missions, `lanes` of them stepped together; a lane whose mission has ended takes the next.

    So no mission waits for the longest of those that it began with; only the last ones do. A mission whose record is
    full is put away as it stands.
    """
    count = batch_size(missions)
    # Taking up missions copies the worlds of all lanes: too much for every step of an accelerator's thousands of lanes.
    enough = max(1, lanes // 16)

    def begin(mission: Mission, begun: _Pair | None) -> _Pair:
        if begun is not None:
            return begun
        state = reset(planner, mission, capacity)
        return state, None if keep is None else _empty_log(keep, state)

    def event(mission: Mission, pair: _Pair, key: Key) -> _Pair:
        state, log = pair
        if keep is None or log is None:
            return step(planner, mission, state, key), None
        return _logged(keep, planner, mission, state, key, log)

    go = jax.vmap(event)

    def going(state: State) -> Bool[Array, " l"]:
        return jnp.any(state.active, axis=-1) & ~jnp.any(state.full, axis=-1)

    pair = jax.vmap(begin)(*jax.tree.map(lambda a: a[:lanes], (missions, begun)))
    if lanes == count:  # none waits: a quarter less to compile
        return lax.while_loop(lambda pair: jnp.any(going(pair[0])), lambda pair: go(missions, pair, keys), pair)

    def take_up(new: Bool[Array, ""], mission: Mission, first: _Pair | None, pair: _Pair) -> _Pair:
        return jax.tree.map(partial(jnp.where, new), begin(mission, first), pair)

    def travel(lane: _Lanes) -> _Lanes:
        """Begin what is new, and step until missions have ended: enough of them, or all where none waits."""
        index = jnp.minimum(lane.number, count - 1)
        mission, first, key = jax.tree.map(lambda a: a[index], (missions, begun, keys))
        pair = jax.vmap(take_up)(lane.new, mission, first, lane.state)

        def over(pair: _Pair) -> Bool[Array, " l"]:
            return (lane.number < count) & ~going(pair[0])

        def travelling(pair: _Pair) -> Bool[Array, ""]:
            relief = (lane.waiting < count) & (jnp.sum(over(pair)) >= enough)
            return jnp.any(going(pair[0])) & ~relief

        pair = lax.while_loop(travelling, lambda pair: go(mission, pair, key), pair)
        return put_away(lane._replace(state=pair), over(pair))

    def put_away(lane: _Lanes, over: Bool[Array, " l"]) -> _Lanes:
        """Keep the states of the missions that are over, and give their lanes the next ones."""
        slot = jnp.where(over, lane.number, count)  # what is written beyond the last is dropped
        final = jax.tree.map(lambda all, one: all.at[slot].set(one, mode="drop"), lane.final, lane.state)
        number = jnp.where(over, jnp.minimum(lane.waiting + jnp.cumsum(over) - 1, count), lane.number)
        waiting = jnp.minimum(lane.waiting + jnp.sum(over), count)
        return _Lanes(number, over & (number < count), lane.state, waiting, final)

    final = jax.tree.map(lambda a: jnp.zeros((count, *a.shape[1:]), a.dtype), pair)
    lane = _Lanes(jnp.arange(lanes), jnp.zeros(lanes, bool), pair, jnp.asarray(lanes), final)
    return lax.while_loop(lambda lane: jnp.any(lane.number < count), travel, lane).final


@kept
def _run_sharded(
    planner: Planner,
    missions: Mission,
    begun: _Pair | None,
    key: Key,
    numbers: Int[Array | np.ndarray, " b"],
    devices: int,
    lanes: int,
    capacity: int,
    keep: Keep | None,
) -> _Pair:
    """Final states of missions with these numbers; the batch is padded with its last to a multiple of the devices."""
    arrays, static = eqx.partition(planner, eqx.is_array)
    count = batch_size(missions)
    index = jnp.minimum(jnp.arange(math.ceil(count / devices) * devices), count - 1)
    keys = jax.vmap(partial(jax.random.fold_in, key))(numbers)

    def per_device(arrays: Planner, missions: Mission, begun: _Pair | None, keys: Keys) -> _Pair:
        return _run_lanes(eqx.combine(arrays, static), missions, begun, keys, lanes, capacity, keep)

    mesh = Mesh(np.asarray(missions_devices()[:devices]), ("missions",))
    split, whole = PartitionSpec("missions"), PartitionSpec()
    layout = (whole, split, split, split)
    sharded = jax.shard_map(per_device, mesh=mesh, in_specs=layout, out_specs=split, check_vma=False)
    final = sharded(arrays, *jax.tree.map(lambda a: a[index], (missions, begun, keys)))
    return jax.tree.map(lambda a: a[:count], final)


def refuse_to_cross(has_zones: bool, planner: Planner) -> None:
    """Raise InputError for no-go zones that the planner does not avoid."""
    if has_zones and not planner.avoids_obstacles:
        raise InputError(
            f"{type(planner).__name__}: this planner would cross the scenario's no-go zones; use one that avoids them"
        )


def run_missions(planner: Planner, missions: Mission, key: Key, *, first: int = 0) -> State:
    """Final states of a batch of missions (leading axis b on every array).

    Mission i draws its randomness from `fold_in(key, first + i)`, so a mission's record does not depend on the batch
    it ran in, up to floating-point rounding of batched matrix products. `first` is the number of the batch's first
    mission where a longer batch runs in parts. Raises InputError for no-go zones that the planner does not avoid, and
    for a planner whose `decide` does not answer as it owes to.
    """
    return _run(planner, missions, key, first, None)[0]


def run_recorded(planner: Planner, missions: Mission, key: Key, keep: Keep, *, first: int = 0) -> tuple[State, Events]:
    """As `run_missions`, and of every decision `keep(message)`; `keep` is a function that JAX can trace."""
    states, log = _run(planner, missions, key, first, keep)
    assert log is not None
    events = np.asarray(states.events)
    last = int(events.max(initial=0))
    agent, time, kept = jax.tree.map(lambda rows: np.asarray(rows)[:, :last], tuple(log))
    return states, Events(agent, np.arange(last) < events[:, None], time, kept)


def _run(planner: Planner, missions: Mission, key: Key, first: int, keep: Keep | None) -> _Pair:
    """Run, and where a planner's steps are so small that the record of a route is full, go on with more room."""
    refuse_to_cross(missions.shape.has_zones, planner)
    # On the host, where nothing has to be compiled for it.
    planner = planner.on(jax.device_put(jax.tree.map(lambda a: a[0], jax.device_get(missions.problem))))
    numbers = np.arange(first, first + batch_size(missions), dtype=np.int32)
    capacity = route_capacity(missions.problem, planner)
    most = _MOST_ROOM * capacity
    done = _run_some(planner, missions, None, key, numbers, capacity, keep)
    while (rest := np.flatnonzero(np.asarray(done[0].full).any(axis=-1))).size:
        # Through the host: few missions may run on fewer devices than all of them did.
        done = jax.tree.map(jnp.asarray, jax.device_get(done))
        some, begun = jax.tree.map(lambda a: a[rest], (missions, done))
        if capacity < most:
            capacity = min(4 * capacity, most)
            begun = _with_room(begun, capacity)
        else:
            begun = _stopped_short(begun[0]), begun[1]
        longer = jax.device_get(_run_some(planner, some, begun, key, numbers[rest], capacity, keep))
        done = _put_back(done, rest, longer)
    return done


def _run_some(
    planner: Planner,
    missions: Mission,
    begun: _Pair | None,
    key: Key,
    numbers: Int[np.ndarray, " b"],
    capacity: int,
    keep: Keep | None,
) -> _Pair:
    """The missions from where they are, on all devices."""
    count = batch_size(missions)
    devices = min(len(missions_devices()), count)
    # No more lanes than it takes: where all missions are equally long, a last round with empty lanes costs as much.
    each = math.ceil(count / devices)
    lanes = math.ceil(each / math.ceil(each / lanes_at_most(planner)))
    return _run_sharded(planner, missions, begun, key, numbers, devices, lanes, capacity, keep)


def _with_room(begun: _Pair, capacity: int) -> _Pair:
    """The missions with more room, in which nobody waits for it; leading axis b."""
    state, log = with_capacity(begun[0], capacity), begun[1]
    if log is not None:
        added = _most_events(state) - log.agent.shape[1]
        log = jax.tree.map(lambda a: jnp.pad(a, [(0, 0), (0, added), *[(0, 0)] * (a.ndim - 2)]), log)
    return state, log


def _stopped_short(state: State) -> State:
    """The missions without those agents whose record is full."""
    status = jnp.where(state.full, RECORD_FULL, state.status).astype(jnp.int8)
    return eqx.tree_at(lambda s: (s.status, s.full), state, (status, jnp.zeros_like(state.full)))


def _put_back(done: _Pair, rest: np.ndarray, longer: _Pair) -> _Pair:
    """Both results as one, those that went on in their places."""
    if (room := longer[0].route_time.shape[-1]) > done[0].route_time.shape[-1]:
        done = _with_room(done, room)
    return jax.tree.map(lambda all, some: all.at[rest].set(some), done, longer)
