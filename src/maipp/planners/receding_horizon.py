"""`receding-horizon`: optimise the next legs in continuous space, travel the first, plan again."""

import equinox as eqx
import jax.numpy as jnp

from maipp.errors import InputError
from maipp.planners.announced import Announcement, nothing_announced, with_announced
from maipp.planners.headings import bend, walk_bent, within_leg
from maipp.planners.leg_planner import LegPlanner
from maipp.planners.lookahead import measurement_offsets
from maipp.planners.team_plan import TeamPlan, nothing_planned, plan_team
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.simulator.decision import Decision, Observation, PyTree
from maipp.typing import Key


class RecedingHorizon(LegPlanner):
    """The next `horizon` legs, one measurement each, with the lowest expected Tr(P); travel one leg, plan again.

    A leg may bend once, so that the next measurement may lie nearer than the way to it is long.

    Decentralised: the agent that is due plans its own legs and counts those the others announced as measured. With
    `joint=True` it plans the legs of the whole team together, for comparison: not a method for the field.
    """

    joint: bool = eqx.field(static=True, default=False)  # plan all agents' legs together
    sweeps: int = eqx.field(static=True, default=2)  # joint: times each agent's plan is optimised given the others'

    @property
    def waypoints_per_decision(self) -> int:
        """The bend of a leg and its end."""
        return 2

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
        """The last plan: displacements (h, 2), units of a leg."""
        return jnp.zeros((self.horizon, 2)).at[:, 0].set(1.0)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The first leg of the best plan found."""
        offsets = measurement_offsets(observation.to_next_measurement, self.scenario.measurement_interval, self.horizon)
        steps = jnp.diff(offsets, prepend=0.0)
        affordable = offsets <= observation.remaining + DISTANCE_TOLERANCE
        if self.joint:
            plan = plan_team(self, self.sweeps, key, observation, memory, steps, affordable)
        else:
            belief = with_announced(observation, observation.messages, self.scenario.virtual_value)
            inside, known = observation.inside, observation.belief.variance
            plans = self.plan_legs(key, belief, inside, observation.position, memory, steps, affordable, known)
            plan = plans.best
        extent = self.scenario.extent
        points = walk_bent(observation.position, plan, steps, extent)
        times = jnp.where(affordable, observation.time + offsets / observation.speed, jnp.inf)
        message = Announcement(points, times)
        if self.joint:
            message = TeamPlan(message, observation.remaining - steps[0])
        way = jnp.stack([bend(observation.position, points[0], steps[0], extent), points[0]])
        return Decision(way, message, jnp.roll(within_leg(plan), -1, axis=0))
