"""What an agent of an environment may do, and what its action makes of the survey."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.engine.advance import advance
from maipp.engine.decision import Decision, Observation
from maipp.engine.mission import Mission
from maipp.engine.rows import pick
from maipp.engine.state import State
from maipp.environments.announcer import Announcer, nothing_told
from maipp.environments.form import Form
from maipp.environments.view import RemainingLeg, View, candidates_from, view_of
from maipp.problem import ScenarioLike
from maipp.roadmap import SHORTEST_LEG, Roadmap
from maipp.typing import Array, Bool, Float, Index, Int, Point

Action = Int[Array, ""] | Float[Array, "2"]  # index of a neighbour, or a waypoint, domain units


class Options(NamedTuple):
    """What an agent can do from the end of its leg."""

    targets: Float[Array, "k 2"]  # where the actions lead to, domain units
    allowed: Bool[Array, " k"]
    full: Bool[Array, ""]  # the record of its route has no room for another leg


def options(mission: Mission, roadmap: Roadmap | None, state: State, agent: Index) -> Options:
    """What this agent, whose roadmap it is, can do; nothing once it has turned for home."""
    remaining = pick(mission.params.spendable, agent) - pick(state.odometer, agent)
    targets, allowed = candidates_from(mission.problem, roadmap, pick(state.leg, agent)[-1], remaining)
    capacity, legs = state.route.shape[-2], state.leg.shape[-2] - 1
    full = pick(state.route_length, agent) + legs > capacity
    return Options(targets, allowed & ~full & ~pick(state.homeward, agent), full)


def sight(form: Form, mission: Mission, state: State, observation: Observation, there: Options) -> View:
    """What the agent of this observation sees at the state's time."""
    agent = observation.agent
    ahead = jnp.maximum(pick(state.arrival, agent) - state.time, 0.0) * pick(mission.params.speeds, agent)
    ahead = jnp.where(pick(state.active, agent), ahead, 0.0)
    way = RemainingLeg(pick(state.leg, agent)[-1], ahead, there.targets, there.allowed)
    return view_of(mission.problem, form, observation, way)


def view_here(problem: ScenarioLike, form: Form, observation: Observation) -> View:
    """What an agent sees that decides here and now: for planners that ask a policy trained in an environment."""
    way = candidates_from(problem, observation.roadmap, observation.position, observation.remaining)
    return view_of(problem, form, observation, RemainingLeg(observation.position, jnp.zeros(()), *way))


def nearest_allowed(there: Options, position: Point, action: Int[Array, ""]) -> Int[Array, ""]:
    """The action if it is allowed, else the allowed one whose target is nearest to where it would lead.

    What is no neighbour's index stands for staying at `position`.
    """
    known = (action >= 0) & (action < len(there.allowed))
    index = jnp.where(known, action, 0)
    asked = jnp.where(known, there.targets[index], position)
    squared = jnp.sum((there.targets - asked) ** 2, axis=-1)
    nearest = jnp.argmin(jnp.where(there.allowed, squared, jnp.inf))
    return jnp.where(known & there.allowed[index], index, nearest).astype(jnp.int32)


class Moved(NamedTuple):
    """What an action came to."""

    state: State
    replaced: Bool[Array, ""]  # it was not allowed, and another was taken
    stays: Bool[Array, ""]  # it is a waypoint on the spot: nothing is changed, and the agent's survey is over


def move(
    form: Form,
    mission: Mission,
    roadmap: Roadmap | None,
    state: State,
    agent: Index,
    action: Action,
    stop: Bool[Array, ""],
) -> Moved:
    """An agent that has heard the others sets off where its action leads to; or it stops, and the action is not read.

    One that can do nothing stops.
    """
    there, end = options(mission, roadmap, state, agent), pick(state.leg, agent)[-1]
    stop = stop | ~there.allowed.any()
    replaced = stays = jnp.asarray(False)
    if form.actions == "neighbour":
        index = nearest_allowed(there, end, jnp.asarray(action))
        replaced = ~stop & (index != action)
        target = there.targets[index]
    else:
        target = jnp.asarray(action, end.dtype)
        stays = ~stop & (jnp.sum((target - end) ** 2) <= SHORTEST_LEG**2)
    decision = Decision(target[None], jnp.where(stop, nothing_told(), target), (), stop)
    after = advance(Announcer(mission.problem), mission, state, agent, decision)
    if form.actions == "waypoint":
        after = jax.tree.map(lambda new, old: jnp.where(stays, old, new), after, state)
    return Moved(after, replaced, stays)
