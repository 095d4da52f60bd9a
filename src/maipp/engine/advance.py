"""The second half of an event: what a decision changes."""

import dataclasses

import jax
import jax.numpy as jnp

from maipp.engine.decide import Departure, depart_of
from maipp.engine.decision import Decision, Planner
from maipp.engine.mission import Mission
from maipp.engine.polyline import along
from maipp.engine.rows import pick, put
from maipp.engine.state import State
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Index


def advance(planner: Planner, mission: Mission, state: State, agent: Index, decision: Decision) -> State:
    """The state after `agent` set off on its decision: the legs are cut at its budget, measurements get their time.

    Where the record of its route has no room for that, nothing happens but that the state says so (`full`).
    """
    remaining = pick(mission.params.spendable, agent) - pick(state.odometer, agent)
    position, homeward = pick(state.leg, agent)[-1], pick(state.homeward, agent)
    return set_off(mission, state, agent, depart_of(planner, mission, agent, position, remaining, decision, homeward))


def set_off(mission: Mission, state: State, agent: Index, decided: Departure) -> State:
    """The same for a decision in the form in which it can be acted on."""
    active = pick(state.active, agent)
    odometer = pick(state.odometer, agent)
    departure = state.time
    speed = pick(mission.params.speeds, agent)
    position = pick(state.leg, agent)[-1]
    leg, reach, length = decided.leg, decided.reach, decided.length
    capacity, w = state.route.shape[-2], len(reach)
    full = active & decided.go & (pick(state.route_length, agent) + w > capacity)
    acts = active & ~full
    go = acts & decided.go

    # Count measurements rather than compare distances twice, so that none is lost or doubled by rounding.
    interval = mission.params.measurement_interval
    taken = pick(state.taken, agent)
    reached = jnp.floor((odometer + length + DISTANCE_TOLERANCE) / interval).astype(jnp.int32)
    slots = jnp.arange(mission.shape.slots)
    new = (slots >= taken) & (slots < reached)
    offset = jnp.clip((slots + 1) * interval - odometer, 0.0, length)
    spots = along(leg, offset)
    row_x = jnp.where(new[:, None], spots, pick(state.measurement_x, agent))
    row_y = jnp.where(new, mission.field(spots), pick(state.measurement_y, agent))
    row_time = jnp.where(new, departure + offset / speed, pick(state.measurement_time, agent))

    vertex = jnp.arange(capacity) - pick(state.route_length, agent)
    fresh = (vertex >= 0) & (vertex < w)
    at = jnp.clip(vertex, 0, w - 1)
    route = jnp.where(fresh[:, None], leg[1:][at], pick(state.route, agent))
    route_time = jnp.where(fresh, departure + reach[at] / speed, pick(state.route_time, agent))

    def tell(old: Array, new: Array) -> Array:
        return put(old, agent, new, acts)

    return dataclasses.replace(
        state,
        events=state.events + acts.astype(jnp.int32),
        status=put(state.status, agent, decided.status, acts),
        leg=put(state.leg, agent, jnp.where(go, leg, position), acts),
        departure=put(state.departure, agent, departure, acts),
        arrival=put(state.arrival, agent, departure + jnp.where(go, length, 0.0) / speed, acts),
        odometer=put(state.odometer, agent, odometer + length, go),
        taken=put(state.taken, agent, jnp.maximum(reached, taken), go),
        measurement_x=put(state.measurement_x, agent, row_x, go),
        measurement_y=put(state.measurement_y, agent, row_y, go),
        measurement_time=put(state.measurement_time, agent, row_time, go),
        messages=jax.tree.map(tell, state.messages, decided.message),
        memory=jax.tree.map(tell, state.memory, decided.memory),
        route=put(state.route, agent, route, go),
        route_time=put(state.route_time, agent, route_time, go),
        route_length=put(state.route_length, agent, pick(state.route_length, agent) + w, go),
        full=put(state.full, agent, full, jnp.asarray(True)),
    )
