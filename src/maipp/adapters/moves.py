"""The engine's events as an environment needs them: compiled once per scenario, shared by all its environments."""

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.adapters.announcer import Announcer, nothing_told
from maipp.adapters.form import Form
from maipp.adapters.view import View, Way, view_of
from maipp.engine.advance import advance
from maipp.engine.decision import Decision, Observation
from maipp.engine.mission import Mission
from maipp.engine.observe import hear, knowledge, observe, time_tolerance, turn
from maipp.engine.state import State, reset
from maipp.roadmap import nearest_node
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Index, Int

Choice = Int[Array, ""] | Float[Array, "2"]  # index of a neighbour, or a waypoint, domain units


class Move(NamedTuple):
    """What one agent does that has arrived: scalars of the host, arrays within compiled functions."""

    agent: Index | np.integer
    choice: Choice | np.ndarray
    stop: Bool[Array, ""] | np.bool  # it stops, and the choice is not read


def _look(scenario: Scenario, form: Form, mission: Mission, state: State, observation: Observation) -> View:
    """What the agent of this observation sees at the state's time."""
    agent = observation.agent
    ahead = jnp.maximum(state.arrival[agent] - state.time, 0.0) * mission.params.speeds[agent]
    full = state.route_length[agent] + 1 > state.route.shape[-2]
    way = Way(state.leg[agent, -1], jnp.where(state.active[agent], ahead, 0.0), full)
    return view_of(scenario, form, observation, way)


def _depart(scenario: Scenario, form: Form, mission: Mission, state: State, move: Move) -> State:
    """The state after an agent that has heard the others set off on its choice, or stopped."""
    agent, target, stop = jnp.asarray(move.agent), move.choice, jnp.asarray(move.stop)
    if form.actions == "neighbour":
        roadmap = jax.tree.map(lambda a: a[agent], mission.roadmap)
        node = nearest_node(roadmap, state.leg[agent, -1])
        target = jnp.asarray(roadmap.nodes)[roadmap.neighbours[node, move.choice]]
    target = jnp.asarray(target, state.leg.dtype)
    decision = Decision(target[None], jnp.where(stop, nothing_told(), target), (), stop)
    return advance(Announcer(scenario), mission, state, agent, decision)


def _wake(scenario: Scenario, form: Form, mission: Mission, state: State) -> tuple[State, Index, View]:
    state, agent, observation = turn(mission, state)
    return state, agent, _look(scenario, form, mission, state, observation)


@partial(jax.jit, static_argnums=(0, 1))
def begin(scenario: Scenario, form: Form, mission: Mission) -> tuple[State, Index, View]:
    """The state when the first agent is due, that agent, and what it sees."""
    return _wake(scenario, form, mission, reset(Announcer(scenario), mission))


@partial(jax.jit, static_argnums=(0, 1))
def play(scenario: Scenario, form: Form, mission: Mission, state: State, move: Move) -> tuple[State, Index, View]:
    """The due agent sets off or stops; then the state when the next one is due, that agent, and what it sees."""
    return _wake(scenario, form, mission, _depart(scenario, form, mission, state, move))


@partial(jax.jit, static_argnums=(0, 1))
def look(scenario: Scenario, form: Form, mission: Mission, state: State, agent: Index) -> View:
    """What an agent would see at this moment; nothing is taken over into the state."""
    heard_state, heard = hear(mission, state, agent)
    observation = observe(mission, knowledge(mission, heard_state, agent, heard))
    return _look(scenario, form, mission, state, observation)


@partial(jax.jit, static_argnums=(0,))
def start(scenario: Scenario, mission: Mission) -> State:
    """The state before the first event."""
    return reset(Announcer(scenario), mission)


@partial(jax.jit, static_argnums=(0, 1))
def depart(scenario: Scenario, form: Form, mission: Mission, state: State, move: Move) -> State:
    """One whole event: an agent that has arrived hears the others and sets off, or stops."""
    agent = jnp.asarray(move.agent)
    state = dataclasses.replace(state, time=jnp.maximum(state.time, state.arrival[agent]))
    state, _ = hear(mission, state, agent)
    return _depart(scenario, form, mission, state, move)


@partial(jax.jit, static_argnums=(0, 1))
def look_all(
    scenario: Scenario, form: Form, mission: Mission, state: State
) -> tuple[Float[Array, ""], Bool[Array, " m"], View]:
    """The time of the next arrival, who arrives then, and what every agent sees at that moment (leading axis m)."""
    arrival = jnp.where(state.active, state.arrival, jnp.inf)
    due = state.active & (arrival <= jnp.min(arrival) + time_tolerance(mission.params.speeds))
    time = jnp.where(state.active.any(), jnp.maximum(state.time, jnp.min(arrival)), state.time)

    def one(agent: Index) -> View:
        own_time = jnp.where(due[agent], jnp.maximum(time, state.arrival[agent]), time)
        return look(scenario, form, mission, dataclasses.replace(state, time=own_time), agent)

    return time, due, jax.vmap(one)(jnp.arange(scenario.agents))
