"""The first half of an event: whose turn it is, whom that agent hears, and what it knows."""

import dataclasses

import jax
import jax.numpy as jnp

from maipp.belief import Matern32, condition_near
from maipp.engine.decision import Observation
from maipp.engine.mission import Mission
from maipp.engine.rows import pick, put
from maipp.engine.state import State, positions
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Array, Bool, Index

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
        offset = where - pick(where, agent)
        within = jnp.sum(offset * offset, axis=-1) <= scenario.comm_range**2
    own = jnp.eye(scenario.agents, dtype=bool)[:, :, None] & _taken_by_now(scenario, state)[None]
    knows = state.known | own  # (m, m, s)
    hearing = within | (everyone == agent)
    learned = jnp.any(knows & hearing[:, None, None], axis=0)
    known = put(state.known, agent, learned, jnp.asarray(True))
    return dataclasses.replace(state, known=known), within & (everyone != agent)


def observe(scenario: Scenario, mission: Mission, state: State, agent: Index, heard: Bool[Array, " m"]) -> Observation:
    """What `agent` knows at `state.time`. Parts a planner does not read are never computed (dead code in XLA)."""
    x = state.measurement_x.reshape(-1, 2)
    y = state.measurement_y.reshape(-1)
    known = pick(state.known, agent).reshape(-1)
    extra_noise = None
    if mission.prior is not None:  # decided while tracing: without a prior nothing is added to the computation
        x, y, known, extra_noise = mission.prior.after(x, y, known, scenario.noise)
    interval = scenario.measurement_interval
    odometer = pick(state.odometer, agent)
    where = positions(state, mission.speeds)
    kernel = Matern32(scenario.length_scale, scenario.signal_variance)
    position = pick(where, agent)
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
    budget = pick(mission.budgets, agent)
    return Observation(
        agent=agent,
        time=state.time,
        position=position,
        start=pick(mission.start, agent),
        budget=budget,
        remaining=budget - odometer,
        speed=pick(mission.speeds, agent),
        to_next_measurement=(pick(state.taken, agent) + 1) * interval - odometer,
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


def turn(scenario: Scenario, mission: Mission, state: State) -> tuple[State, Index, Observation]:
    """The first half of an event: the state once the due agent has heard the others, who that is, what it observes."""
    agent = due_agent(scenario, state)
    running = jnp.any(state.active)
    now = jnp.where(running, pick(state.arrival, agent), state.time)
    state = dataclasses.replace(state, time=jnp.maximum(state.time, now))
    heard_state, heard = hear(scenario, mission, state, agent)
    state = jax.tree.map(lambda new, old: jnp.where(running, new, old), heard_state, state)
    return state, agent, observe(scenario, mission, state, agent, heard)
