"""An agent's decision: the planner's answer to what it knows, as the polyline that its budget allows."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp

from maipp.engine.decision import Decision, Knowledge, Observation, Planner, PyTree
from maipp.engine.mission import Mission
from maipp.engine.observe import observe
from maipp.engine.polyline import cut_leg
from maipp.engine.state import BY_PLANNER, NOT_FINITE, SPENT, TRAVELLING
from maipp.problem import Problem
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Float, Int, Key, Point


class Departure(eqx.Module):
    """What an agent does that was told so: the one form of a decision that anything acts on."""

    leg: Float[Array, "v 2"]  # from its position through the waypoints, cut where its budget ends, domain units
    reach: Float[Array, " w"]  # distance from its position to each waypoint of the leg; the last is its length
    stopped_by: Int[Array, ""]  # why it stops here, as in `State`; 0: it goes
    message: PyTree
    memory: PyTree

    @property
    def go(self) -> Any:
        """Whether it goes on."""
        return self.stopped_by == TRAVELLING

    @property
    def length(self) -> Float[Array, ""]:
        """Of the leg, domain units."""
        return self.reach[-1]


def depart(problem: Problem, position: Point, remaining: Float[Array, ""], decision: Decision) -> Departure:
    """The decision of an agent at `position` as it can be acted on; who would go nowhere stops.

    With nothing left to travel its waypoints are no fault of the planner, whatever they are.
    """
    leg, reach = cut_leg(problem.params.extent, position, decision.waypoints, remaining)
    reason = jnp.where(reach[-1] > DISTANCE_TOLERANCE, TRAVELLING, SPENT)
    reason = jnp.where(jnp.isfinite(decision.waypoints).all(), reason, NOT_FINITE)
    reason = jnp.where(remaining > DISTANCE_TOLERANCE, reason, SPENT)
    reason = jnp.where(jnp.asarray(decision.stop, bool), BY_PLANNER, reason)
    return Departure(leg, reach, reason.astype(jnp.int8), decision.message, decision.memory)


def ask(planner: Planner, mission: Mission, key: Key, observation: Observation, memory: PyTree) -> Decision:
    """What the planner answers, in this mission's own numbers."""
    return planner.on(mission.problem).decide(key, observation, memory)


@eqx.filter_jit
def decide(planner: Planner, mission: Mission, key: Key, known: Knowledge, memory: PyTree) -> Departure:
    """One decision of one agent from what it knows, compiled: what a survey outside of batches asks."""
    observation = observe(mission, known)
    decision = ask(planner, mission, key, observation, memory)
    return depart(mission.problem, observation.position, observation.remaining, decision)
