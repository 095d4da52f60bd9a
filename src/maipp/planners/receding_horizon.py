"""`receding-horizon`: optimise the next legs in continuous space, travel the first, plan again."""

import equinox as eqx
import jax.numpy as jnp

from maipp.errors import InputError
from maipp.planners.announced import Announcement, nothing_announced, with_announced
from maipp.planners.headings import walk
from maipp.planners.leg_planner import LegPlanner
from maipp.planners.lookahead import measurement_offsets
from maipp.planners.team_plan import TeamPlan, nothing_planned, plan_team
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.simulator.decision import Decision, Observation, PyTree
from maipp.typing import Key


class RecedingHorizon(LegPlanner):
    """The next `horizon` legs, one measurement each, with the lowest predicted Tr(P); travel one leg, plan again.

    Decentralised: the agent that is due plans its own legs and counts those the others announced as measured. With
    `joint=True` it plans the legs of the whole team together: the strongest reference, not a method for the field.
    """

    joint: bool = eqx.field(static=True, default=False)  # plan all agents' legs together
    sweeps: int = eqx.field(static=True, default=2)  # joint: times each agent's plan is optimised given the others'

    def check(self) -> None:
        """Raise InputError for options out of range."""
        super().check()
        if self.sweeps < 1:
            raise InputError(f"sweeps={self.sweeps}: give a whole number >= 1")

    def empty_message(self) -> PyTree:
        """The announced legs; in joint form with what the others need to plan for the sender."""
        announced = nothing_announced(self.horizon)
        return nothing_planned(announced) if self.joint else announced

    def initial_memory(self) -> PyTree:
        """Headings of the last plan (h,), radians."""
        return jnp.zeros(self.horizon)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The first leg of the best plan found."""
        offsets = measurement_offsets(observation.to_next_measurement, self.scenario.measurement_interval, self.horizon)
        steps = jnp.diff(offsets, prepend=0.0)
        affordable = offsets <= observation.remaining + DISTANCE_TOLERANCE
        if self.joint:
            headings = plan_team(self, self.sweeps, key, observation, memory, steps, affordable)
        else:
            belief = with_announced(observation, observation.messages, self.scenario.virtual_value)
            headings = self.plan_legs(key, belief, observation.inside, observation.position, memory, steps, affordable)
        points = walk(observation.position, headings, steps, self.scenario.extent)
        times = jnp.where(affordable, observation.time + offsets / observation.speed, jnp.inf)
        message = Announcement(points, times)
        if self.joint:
            message = TeamPlan(message, observation.remaining - steps[0])
        return Decision(points[:1], message, jnp.roll(headings, -1))
