"""Planning legs in the plane: `PlanSearch` scores random plans by an `Objective` and refines the best by gradient.

A planner holds a `PlanSearch` as a part. Its `outlook` is what an agent plans from, `plan` finds the legs, `set_out`
turns them into the way of the first leg, what is told the others, and what is left of the plan.
"""

from maipp.planners.search.outlook import Ahead, Outlook
from maipp.planners.search.plan_search import LegMemory, PlanSearch

__all__ = ["Ahead", "LegMemory", "Outlook", "PlanSearch"]
