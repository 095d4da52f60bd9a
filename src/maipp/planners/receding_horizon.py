"""`receding-horizon`: optimise the next legs in continuous space, travel the first, plan again."""

from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option, part
from maipp.errors import InputError
from maipp.planners.announced.announcement import TeamPlan, nothing_announced, nothing_planned, with_announced
from maipp.planners.search.joint import plan_team
from maipp.planners.search.plan_search import LegMemory, PlanSearch
from maipp.typing import Key


class RecedingHorizon(Planner):
    """The next `horizon` legs, one measurement each, with the lowest expected Tr(P); travel one leg, plan again.

    A leg may bend once, so that the next measurement may lie nearer than the way to it is long.

    Decentralised: the agent that is due plans its own legs and counts those the others announced as measured. With
    `joint=True` it plans the legs of the whole team together, for comparison: not a method for the field.
    """

    search: PlanSearch = part(PlanSearch)
    joint: bool = option(False, meaning="plan all agents' legs together")
    sweeps: int = option(2, meaning="joint: times each agent's plan is optimised given the others'")

    avoids_obstacles = True

    def check(self) -> None:
        """Raise InputError for options out of range."""
        if self.sweeps < 1:
            raise InputError(f"sweeps={self.sweeps}: give a whole number >= 1")

    @property
    def waypoints_per_decision(self) -> int:
        """Those of a leg."""
        return self.search.waypoints

    def empty_message(self) -> PyTree:
        """The announced legs; in joint form with what the others need to plan for the sender."""
        announced = nothing_announced(self.search.legs)
        return nothing_planned(announced) if self.joint else announced

    def initial_memory(self) -> PyTree:
        """The last plan, and nothing heard."""
        return self.search.first_memory()

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The first leg of the best plan found."""
        search, heard, ahead = self.search, memory.heard, self.search.ahead(observation)
        if self.joint:
            belief = with_announced(observation, observation.messages.legs, self.scenario.virtual_value)
            outlook = search.outlook(observation, belief, ahead)
            plan = plan_team(search, self.sweeps, key, observation, memory.plan, ahead, outlook.prospect)
        else:
            belief, heard = search.counted(observation, heard)
            outlook = search.outlook(observation, belief, ahead)
            plan = search.plan(key, outlook, memory.plan).best
        way, message, left = search.set_out(observation, outlook, plan, ahead)
        if self.joint:
            message = TeamPlan(message, observation.remaining - ahead.steps[0])
        return Decision(way, message, LegMemory(left, heard))
