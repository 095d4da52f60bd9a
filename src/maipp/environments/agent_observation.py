"""The survey in steps to the next arrival: agents that have arrived act together, and everybody is seen."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief
from maipp.engine.decision import Observation
from maipp.engine.mission import Mission
from maipp.engine.observe import hear, knowledge, observe, time_tolerance
from maipp.engine.rows import pick, put
from maipp.engine.state import State
from maipp.environments.environment import Environment, EnvState, mission_of, worth
from maipp.environments.moves import move, options, sight
from maipp.environments.view import View
from maipp.typing import Array, Bool, Float, Index, Int


class AgentObservation(NamedTuple):
    """What one agent sees at a moment, or all of them (leading axis m)."""

    view: View
    time: Float[Array, "*m"]
    due: Bool[Array, "*m"]  # it has arrived; else it is under way
    full: Bool[Array, "*m"]  # the record of its route has no room for another leg
    gained: Float[Array, "*m"]  # reward since its last decision, without that for its end


def _heard(mission: Mission, survey: State, agent: Index) -> Observation:
    """What an agent observes at the survey's time; nothing is taken over into the state."""
    heard_state, heard = hear(mission, survey, agent)
    return observe(mission, knowledge(mission, heard_state, agent, heard))


def _now(
    env: Environment,
    state: EnvState,
    mission: Mission,
    survey: State,
    agent: Index,
    params: Mission,
    belief: Belief | None = None,
) -> AgentObservation:
    """What an agent sees at the survey's time; `belief` is what it believes, where that is known."""
    observation = _heard(mission, survey, agent)
    roadmap = env.roadmap(params, state.row, agent)
    known = observation.belief if belief is None else belief
    observation = dataclasses.replace(observation, roadmap=roadmap, belief=known)
    there = options(mission, roadmap, survey, agent)
    view = sight(env.form, mission, survey, observation, there)
    gained = worth(env.kind, pick(state.before, agent), view.trace)
    return AgentObservation(view, survey.time, jnp.asarray(True), there.full, gained)


def observe_agent(env: Environment, state: EnvState, agent: Index, params: Mission) -> AgentObservation:
    """What one agent, whether it is due or not, would see at this moment."""
    return _now(env, state, mission_of(params, state), state.survey, agent, params)


def believe_alike(mission: Mission) -> bool:
    """Whether all agents believe the same at a moment: everybody is heard, and no belief is of a part of what is known.

    But for what is measured within the time tolerance after it.
    """
    slots = mission.shape.agents * mission.shape.slots + (0 if mission.prior is None else mission.prior.y.shape[0])
    return not mission.shape.limited and slots <= mission.shape.belief_capacity


def observe_agents(env: Environment, state: EnvState, params: Mission) -> tuple[EnvState, AgentObservation]:
    """What every agent sees when the next one arrives; who is due then is rewarded from there on."""
    mission, survey = mission_of(params, state), state.survey
    arrival = jnp.where(survey.active, survey.arrival, jnp.inf)
    due = survey.active & (arrival <= jnp.min(arrival) + time_tolerance(mission.params.speeds))
    time = jnp.where(survey.active.any(), jnp.maximum(survey.time, jnp.min(arrival)), survey.time)

    belief = None
    if believe_alike(mission):
        belief = _heard(mission, dataclasses.replace(survey, time=time), jnp.int32(0)).belief

    def one(agent: Index) -> AgentObservation:
        own = jnp.where(due[agent], jnp.maximum(time, survey.arrival[agent]), time)
        seen = _now(env, state, mission, dataclasses.replace(survey, time=own), agent, params, belief)
        return seen._replace(time=time, due=due[agent])

    seen = jax.vmap(one)(jnp.arange(params.shape.agents))
    return state._replace(before=jnp.where(due, seen.view.trace, state.before)), seen


def act(
    env: Environment,
    state: EnvState,
    actions: Int[Array, " m"] | Float[Array, "m 2"],
    acting: Bool[Array, " m"],
    stops: Bool[Array, " m"],
    params: Mission,
) -> tuple[EnvState, Bool[Array, " m"]]:
    """Agents that have arrived set off or stop, in the order of their index; which actions were replaced.

    None hears what another one announces in the same step.
    """
    mission = mission_of(params, state)

    def one(so_far: tuple[State, Array, Array]) -> tuple[State, Array, Array]:
        survey, replaced, left = so_far
        agent = jnp.argmax(left)
        now = dataclasses.replace(survey, time=jnp.maximum(survey.time, pick(survey.arrival, agent)))
        heard, _ = hear(mission, now, agent)
        roadmap = env.roadmap(params, state.row, agent)
        moved = move(env.form, mission, roadmap, heard, agent, actions[agent], stops[agent])
        yes = jnp.asarray(True)
        return moved.state, put(replaced, agent, moved.replaced, yes), put(left, agent, ~yes, yes)

    # Seldom more than one: a loop over those that act, not over the team.
    begun = state.survey, jnp.zeros(params.shape.agents, bool), acting
    survey, replaced, _ = lax.while_loop(lambda so_far: so_far[2].any(), one, begun)
    return state._replace(survey=survey), replaced
