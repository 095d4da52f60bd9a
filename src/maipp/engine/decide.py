"""An agent's decision: the planner's answer to what it knows, as the polyline that its budget allows."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.engine.decision import Decision, Knowledge, Observation, Planner, PyTree
from maipp.engine.decision_checks import decided
from maipp.engine.homing import led_home
from maipp.engine.mission import Mission
from maipp.engine.observe import observe
from maipp.engine.polyline import cut_leg, distances
from maipp.engine.state import AT_HOME, BY_PLANNER, HOMEWARD, NOT_FINITE, SPENT, TRAVELLING
from maipp.kept import kept
from maipp.problem import Problem
from maipp.roadmap import Home
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index, Int, Key, Point


class Departure(eqx.Module):
    """What an agent does that was told so: the one form of a decision that anything acts on."""

    leg: Float[Array, "v 2"]  # from its position through the waypoints, cut where its budget ends, domain units; home
    reach: Float[Array, " w"]  # distance from its position to each waypoint of the leg; the last is its length
    stopped_by: Int[Array, ""]  # why it stops here, an index of `state.REASONS`; TRAVELLING: it goes
    homeward: Bool[Array, ""]  # whether the leg ends on the way home, which it then follows to its end
    message: PyTree
    memory: PyTree

    @property
    def go(self) -> Any:
        """Whether it goes on."""
        return self.stopped_by == TRAVELLING

    @property
    def status(self) -> Int[Array, ""]:
        """What the agent does from here on, as in `State`."""
        return jnp.where(self.go & self.homeward, HOMEWARD, self.stopped_by).astype(jnp.int8)

    @property
    def length(self) -> Float[Array, ""]:
        """Of the leg, domain units."""
        return self.reach[-1]


def depart(
    problem: Problem,
    position: Point,
    remaining: Float[Array, ""],
    decision: Decision,
    home: Home | None = None,
    homeward: Bool[Array, ""] | None = None,
    nothing: PyTree = None,
) -> Departure:
    """The decision of an agent at `position` as it can be acted on; who would go nowhere stops.

    With nothing left to travel its waypoints are no fault of the planner, whatever they are. An agent that has a `home`
    stops there, whatever it would stop for, and leaves its leg in time; one that is `homeward` already goes on home.
    Whoever does so announces `nothing` instead of what its planner wanted.
    """
    leg, reach = cut_leg(problem.params.extent, position, decision.waypoints, remaining)
    reason = jnp.where(reach[-1] > DISTANCE_TOLERANCE, TRAVELLING, SPENT)
    reason = jnp.where(jnp.isfinite(decision.waypoints).all(), reason, NOT_FINITE)
    reason = jnp.where(remaining > DISTANCE_TOLERANCE, reason, SPENT)
    reason = jnp.where(jnp.asarray(decision.stop, bool), BY_PLANNER, reason)
    turns, message = jnp.asarray(False), decision.message
    if home is not None:
        follows = reason == TRAVELLING
        if homeward is not None:
            follows &= ~homeward
            reason = jnp.where(homeward, AT_HOME, reason)
        leg = jnp.where(jnp.isfinite(leg), leg, position)
        leg, turns = led_home(home, leg, reach[-1], remaining, problem.params.measurement_interval, follows)
        reach = distances(leg)[1:]
        here = reach[-1] <= DISTANCE_TOLERANCE
        reason = jnp.where(here, jnp.where(reason == TRAVELLING, SPENT, reason), TRAVELLING)
        message = jax.tree.map(lambda empty, told: jnp.where(turns, empty, told), nothing, message)
    return Departure(leg, reach, reason.astype(jnp.int8), turns, message, decision.memory)


def depart_of(
    planner: Planner,
    mission: Mission,
    agent: Index,
    position: Point,
    remaining: Float[Array, ""],
    decision: Decision,
    homeward: Bool[Array, ""],
) -> Departure:
    """The decision of an agent of this mission as it can be acted on."""
    home = mission.home_of(agent)
    nothing = None if home is None else planner.on(mission.problem).empty_message()
    return depart(mission.problem, position, remaining, decision, home, homeward, nothing)


def ask(planner: Planner, mission: Mission, key: Key, observation: Observation, memory: PyTree) -> Decision:
    """What the planner answers, in this mission's own numbers. Raises `InputError` where it owes something else."""
    return decided(planner.on(mission.problem), key, observation, memory)


@kept
def decide(planner: Planner, mission: Mission, key: Key, known: Knowledge, memory: PyTree) -> Departure:
    """One decision of one agent from what it knows, compiled: what a survey outside of batches asks."""
    observation = observe(mission, known)
    decision = ask(planner, mission, key, observation, memory)
    where = known.agent, observation.position, observation.remaining
    return depart_of(planner, mission, *where, decision, known.homeward)
