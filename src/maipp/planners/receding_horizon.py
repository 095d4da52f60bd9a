"""`receding-horizon`: optimise the next legs in continuous space, travel the first, plan again."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, PyTree, option
from maipp.errors import InputError
from maipp.planners.announced import Announcement, nothing_announced, with_announced
from maipp.planners.leg_planner import LegPlanner
from maipp.planners.team_plan import TeamPlan, nothing_planned, plan_team
from maipp.planners.told import latest
from maipp.typing import Array, Float, Key


class LegMemory(NamedTuple):
    """What an agent remembers from decision to decision."""

    plan: Float[Array, "h 2"]  # what is left of its last plan: displacements, units of a leg
    heard: Announcement  # last heard from each agent, leading axis m


def first_memory(horizon: int, agents: int) -> LegMemory:
    """The memory of an agent that has not planned yet."""
    nothing = nothing_announced(horizon)
    heard = jax.tree.map(lambda a: jnp.broadcast_to(a, (agents, *a.shape)), nothing)
    return LegMemory(jnp.zeros((horizon, 2)).at[:, 0].set(1.0), heard)


class RecedingHorizon(LegPlanner):
    """The next `horizon` legs, one measurement each, with the lowest expected Tr(P); travel one leg, plan again.

    A leg may bend once, so that the next measurement may lie nearer than the way to it is long.

    Decentralised: the agent that is due plans its own legs and counts those the others announced as measured. With
    `joint=True` it plans the legs of the whole team together, for comparison: not a method for the field.
    """

    joint: bool = option(False, meaning="plan all agents' legs together")
    sweeps: int = option(2, meaning="joint: times each agent's plan is optimised given the others'")

    def check(self) -> None:
        """Raise InputError for options out of range."""
        super().check()
        if self.sweeps < 1:
            raise InputError(f"sweeps={self.sweeps}: give a whole number >= 1")

    def empty_message(self) -> PyTree:
        """The announced legs; in joint form with what the others need to plan for the sender."""
        announced = nothing_announced(self.legs)
        return nothing_planned(announced) if self.joint else announced

    def initial_memory(self) -> PyTree:
        """The last plan, and nothing heard."""
        return first_memory(self.legs, self.scenario.agents)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The first leg of the best plan found."""
        heard, ahead = memory.heard, self.ahead(observation)
        if self.joint:
            plan = plan_team(self, self.sweeps, key, observation, memory.plan, ahead)
            belief = with_announced(observation, observation.messages.legs, self.scenario.virtual_value)
        else:
            heard = latest(observation.heard, observation.messages, heard)
            belief = with_announced(observation, heard, self.scenario.virtual_value, self.recall)
            plan = self.plan_legs(
                key,
                belief,
                observation.inside,
                observation.position,
                memory.plan,
                ahead.steps,
                ahead.affordable,
                observation.belief.variance,
                meeting=self.meeting(observation),
                remaining=observation.remaining,
            ).best
        way, message, left = self.set_out(observation, belief, plan, ahead)
        if self.joint:
            message = TeamPlan(message, observation.remaining - ahead.steps[0])
        return Decision(way, message, LegMemory(left, heard))
