"""The second half of an event: what a decision changes."""

import dataclasses

import jax
import jax.numpy as jnp

from maipp.engine.decision import Decision, Planner
from maipp.engine.mission import Mission
from maipp.engine.polyline import along, cut_leg
from maipp.engine.rows import pick, put
from maipp.engine.state import BY_PLANNER, NOT_FINITE, RECORD_FULL, SPENT, TRAVELLING, State, route_capacity
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Array, Bool, Float, Index, Int


def advance(
    scenario: Scenario, planner: Planner, mission: Mission, state: State, agent: Index, decision: Decision
) -> State:
    """The state after `agent` set off on its decision: the legs are cut at its budget, measurements get their time."""
    active = pick(state.active, agent)
    odometer = pick(state.odometer, agent)
    remaining = pick(mission.budgets, agent) - odometer
    departure = state.time
    speed = pick(mission.speeds, agent)
    position = pick(state.leg, agent)[-1]

    leg, reach = cut_leg(scenario, position, decision.waypoints, remaining)
    length = reach[-1]
    capacity = route_capacity(scenario, planner)
    w = planner.waypoints_per_decision
    full = pick(state.route_length, agent) + w > capacity
    reason = _stopped_by(decision, remaining, length, full)
    go = active & (reason == TRAVELLING)

    # Count measurements rather than compare distances twice, so that none is lost or doubled by rounding.
    interval = scenario.measurement_interval
    taken = pick(state.taken, agent)
    reached = jnp.floor((odometer + length + DISTANCE_TOLERANCE) / interval).astype(jnp.int32)
    slots = jnp.arange(scenario.measurements_per_agent)
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
        return put(old, agent, new, active)

    return dataclasses.replace(
        state,
        events=state.events + active.astype(jnp.int32),
        active=put(state.active, agent, go, jnp.asarray(True)),
        stopped_by=put(state.stopped_by, agent, reason, active),
        leg=put(state.leg, agent, jnp.where(go, leg, position), active),
        departure=put(state.departure, agent, departure, active),
        arrival=put(state.arrival, agent, departure + jnp.where(go, length, 0.0) / speed, active),
        odometer=put(state.odometer, agent, odometer + length, go),
        taken=put(state.taken, agent, jnp.maximum(reached, taken), go),
        measurement_x=put(state.measurement_x, agent, row_x, go),
        measurement_y=put(state.measurement_y, agent, row_y, go),
        measurement_time=put(state.measurement_time, agent, row_time, go),
        messages=jax.tree.map(tell, state.messages, decision.message),
        memory=jax.tree.map(tell, state.memory, decision.memory),
        route=put(state.route, agent, route, go),
        route_time=put(state.route_time, agent, route_time, go),
        route_length=put(state.route_length, agent, pick(state.route_length, agent) + w, go),
    )


def _stopped_by(
    decision: Decision, remaining: Float[Array, ""], length: Float[Array, ""], full: Bool[Array, ""]
) -> Int[Array, ""]:
    """Why an agent goes no farther than here, as in `State.stopped_by`; `length` is that of the leg it wants to go.

    With nothing left to travel its waypoints are no fault of the planner, whatever they are.
    """
    finite = jnp.isfinite(decision.waypoints).all()
    reason = jnp.where(full, RECORD_FULL, TRAVELLING)
    reason = jnp.where(length > DISTANCE_TOLERANCE, reason, SPENT)
    reason = jnp.where(finite, reason, NOT_FINITE)
    reason = jnp.where(remaining > DISTANCE_TOLERANCE, reason, SPENT)
    return jnp.where(jnp.asarray(decision.stop, bool), BY_PLANNER, reason).astype(jnp.int8)
