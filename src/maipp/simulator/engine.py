"""The event-driven engine: whose turn it is, what that agent knows, and what its decision changes."""

from typing import Any

import jax
import jax.numpy as jnp

from maipp.belief import Matern32, condition_near
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.simulator.decision import Decision, Observation, Planner
from maipp.simulator.legs import along, cut_leg
from maipp.simulator.mission import Mission
from maipp.simulator.state import State, positions, route_capacity
from maipp.typing import Array, Bool, Index, Key

# Measurements ahead that planners look; one and two were worse at 5,000 measurements, in which plan came out best.
_AHEAD = 4


def time_tolerance(scenario: Scenario) -> float:
    """The distance tolerance as a time: arrivals closer than this are simultaneous."""
    return DISTANCE_TOLERANCE / max(scenario.speeds)


def window_reach(scenario: Scenario) -> float:
    """How far around an agent a belief of limited capacity favours no measurement, domain units."""
    return _AHEAD * scenario.measurement_interval


def due_agent(scenario: Scenario, state: State) -> Index:
    """The agent that arrives first; agents that arrive together decide in the order of their index."""
    arrival = jnp.where(state.active, state.arrival, jnp.inf)
    return jnp.argmax(arrival <= jnp.min(arrival) + time_tolerance(scenario)).astype(jnp.int32)


def _taken_by_now(scenario: Scenario, state: State) -> Bool[Array, "m s"]:
    """Measurements that have been taken at `state.time`: none is known before the moment it is taken."""
    return state.measurement_time <= state.time + time_tolerance(scenario)


def _pick(array: Array, index: Index) -> Array:
    """Row `index`, by mask: on a CPU a vmapped gather of small rows costs more than reading them all."""
    hot = (jnp.arange(array.shape[0]) == index).reshape(-1, *[1] * (array.ndim - 1))
    if array.dtype == jnp.bool_:
        return jnp.any(hot & array, axis=0)
    return jnp.sum(jnp.where(hot, array, 0), axis=0, dtype=array.dtype)


def _put(array: Array, index: Index, row: Array, when: Bool[Array, ""]) -> Array:
    """`array` with row `index` replaced where `when`."""
    hot = (jnp.arange(array.shape[0]) == index).reshape(-1, *[1] * (array.ndim - 1))
    return jnp.where(hot & when, row, array)


def hear(scenario: Scenario, mission: Mission, state: State, agent: Index) -> tuple[State, Bool[Array, " m"]]:
    """The state after `agent` took over what everyone within range knows now, and whom it heard.

    With a limited range an agent takes over all measurements that the heard ones know at this moment: their own and
    those they had taken over at their last decision (docs/protocol.md, "limited communication").
    """
    everyone = jnp.arange(scenario.agents)
    if scenario.comm_range is None:
        within = jnp.ones(scenario.agents, bool)
    else:
        where = positions(state, mission.speeds)
        offset = where - _pick(where, agent)
        within = jnp.sum(offset * offset, axis=-1) <= scenario.comm_range**2
    own = jnp.eye(scenario.agents, dtype=bool)[:, :, None] & _taken_by_now(scenario, state)[None]
    knows = state.known | own  # (m, m, s)
    hearing = within | (everyone == agent)
    learned = jnp.any(knows & hearing[:, None, None], axis=0)
    known = _put(state.known, agent, learned, jnp.asarray(True))
    return _replace(state, known=known), within & (everyone != agent)


def observe(scenario: Scenario, mission: Mission, state: State, agent: Index, heard: Bool[Array, " m"]) -> Observation:
    """What `agent` knows at `state.time`. Parts a planner does not read are never computed (dead code in XLA)."""
    x = state.measurement_x.reshape(-1, 2)
    y = state.measurement_y.reshape(-1)
    known = _pick(state.known, agent).reshape(-1)
    extra_noise = None
    if mission.prior is not None:  # decided while tracing: without a prior nothing is added to the computation
        x, y, known, extra_noise = mission.prior.after(x, y, known, scenario.noise)
    interval = scenario.measurement_interval
    odometer = _pick(state.odometer, agent)
    where = positions(state, mission.speeds)
    kernel = Matern32(scenario.length_scale, scenario.signal_variance)
    position = _pick(where, agent)
    belief = condition_near(
        kernel,
        x,
        y,
        known,
        mission.grid,
        scenario.noise,
        extra_noise,
        near=position,
        reach=window_reach(scenario),
        capacity=scenario.belief_capacity,
    )
    budget = _pick(mission.budgets, agent)
    return Observation(
        agent=agent,
        time=state.time,
        position=position,
        start=_pick(mission.start, agent),
        budget=budget,
        remaining=budget - odometer,
        speed=_pick(mission.speeds, agent),
        to_next_measurement=(_pick(state.taken, agent) + 1) * interval - odometer,
        measurement_x=x,
        measurement_y=y,
        known=known,
        belief=belief,
        inside=mission.inside,
        heard=heard,
        messages=state.messages,
        positions=where,
        roadmap=jax.tree.map(lambda a: a[agent], mission.roadmap),
    )


def advance(
    scenario: Scenario, planner: Planner, mission: Mission, state: State, agent: Index, decision: Decision
) -> State:
    """The state after `agent` set off on its decision: the legs are cut at its budget, measurements get their time."""
    active = _pick(state.active, agent)
    odometer = _pick(state.odometer, agent)
    remaining = _pick(mission.budgets, agent) - odometer
    departure = state.time
    speed = _pick(mission.speeds, agent)
    position = _pick(state.leg, agent)[-1]

    leg, reach = cut_leg(scenario, position, decision.waypoints, remaining)
    length = reach[-1]
    capacity = route_capacity(scenario, planner)
    w = planner.waypoints_per_decision
    full = _pick(state.route_length, agent) + w > capacity
    go = active & ~jnp.asarray(decision.stop, bool) & (length > DISTANCE_TOLERANCE) & ~full

    # Count measurements rather than compare distances twice, so that none is lost or doubled by rounding.
    interval = scenario.measurement_interval
    taken = _pick(state.taken, agent)
    reached = jnp.floor((odometer + length + DISTANCE_TOLERANCE) / interval).astype(jnp.int32)
    slots = jnp.arange(scenario.measurements_per_agent)
    new = (slots >= taken) & (slots < reached)
    offset = jnp.clip((slots + 1) * interval - odometer, 0.0, length)
    spots = along(leg, offset)
    row_x = jnp.where(new[:, None], spots, _pick(state.measurement_x, agent))
    row_y = jnp.where(new, mission.field(spots), _pick(state.measurement_y, agent))
    row_time = jnp.where(new, departure + offset / speed, _pick(state.measurement_time, agent))

    vertex = jnp.arange(capacity) - _pick(state.route_length, agent)
    fresh = (vertex >= 0) & (vertex < w)
    at = jnp.clip(vertex, 0, w - 1)
    route = jnp.where(fresh[:, None], leg[1:][at], _pick(state.route, agent))
    route_time = jnp.where(fresh, departure + reach[at] / speed, _pick(state.route_time, agent))

    def tell(old: Array, new: Array) -> Array:
        return _put(old, agent, new, active)

    return _replace(
        state,
        events=state.events + active.astype(jnp.int32),
        active=_put(state.active, agent, go, jnp.asarray(True)),
        leg=_put(state.leg, agent, jnp.where(go, leg, position), active),
        departure=_put(state.departure, agent, departure, active),
        arrival=_put(state.arrival, agent, departure + jnp.where(go, length, 0.0) / speed, active),
        odometer=_put(state.odometer, agent, odometer + length, go),
        taken=_put(state.taken, agent, jnp.maximum(reached, taken), go),
        measurement_x=_put(state.measurement_x, agent, row_x, go),
        measurement_y=_put(state.measurement_y, agent, row_y, go),
        measurement_time=_put(state.measurement_time, agent, row_time, go),
        messages=jax.tree.map(tell, state.messages, decision.message),
        memory=jax.tree.map(tell, state.memory, decision.memory),
        route=_put(state.route, agent, route, go),
        route_time=_put(state.route_time, agent, route_time, go),
        route_length=_put(state.route_length, agent, _pick(state.route_length, agent) + w, go),
    )


def _replace(state: State, **changes: Any) -> State:
    """A copy of the state with some fields changed."""
    fields = {name: getattr(state, name) for name in state.__dataclass_fields__}
    return State(**(fields | changes))


def turn(scenario: Scenario, mission: Mission, state: State) -> tuple[State, Index, Observation]:
    """The first half of an event: the state once the due agent has heard the others, who that is, what it observes."""
    agent = due_agent(scenario, state)
    running = jnp.any(state.active)
    now = jnp.where(running, _pick(state.arrival, agent), state.time)
    state = _replace(state, time=jnp.maximum(state.time, now))
    heard_state, heard = hear(scenario, mission, state, agent)
    state = jax.tree.map(lambda new, old: jnp.where(running, new, old), heard_state, state)
    return state, agent, observe(scenario, mission, state, agent, heard)


def step(scenario: Scenario, planner: Planner, mission: Mission, state: State, key: Key) -> State:
    """One event: the due agent hears, observes, decides, sets off. A finished mission is returned unchanged."""
    state, agent, observation = turn(scenario, mission, state)
    memory = jax.tree.map(lambda a: _pick(a, agent), state.memory)
    decision = planner.decide(jax.random.fold_in(key, state.events), observation, memory)
    return advance(scenario, planner, mission, state, agent, decision)
