"""`greedy` and `shared-greedy`: the neighbour whose measurement would lower Tr(P) most."""

import jax.numpy as jnp

from maipp.belief import to_rank
from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option
from maipp.planners.announced.announced_measurements import count_targets, no_target
from maipp.planners.announced.meeting import appointment
from maipp.planners.lookahead import predicted_trace
from maipp.planners.roadmap.edges import feasible_edges
from maipp.typing import Key


class Greedy(Planner):
    """One step ahead on the roadmap: the lowest predicted Tr(P) as if measuring at the next node.

    With `shared=True` every agent announces the node it is heading to, and the others count it as measured.
    """

    shared: bool = option(False, meaning="announce the next node, and count the others' as measured")

    uses_roadmap = True
    avoids_obstacles = True

    def empty_message(self) -> PyTree:
        """The announced target: position (2,), NaN before the first decision."""
        return no_target() if self.shared else ()

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The neighbour with the lowest predicted Tr(P); stops when the budget reaches none."""
        here = feasible_edges(self.scenario, observation, appointment(self.scenario, observation, meet=False))
        value = self.scenario.virtual_value
        belief = count_targets(observation, value) if self.shared else observation.belief
        next_one = here.targets[:, None, :], here.allowed[:, None]
        score = predicted_trace(belief, self.interest, observation.inside, *next_one, virtual_value=value)
        best = jnp.argmin(jnp.where(here.allowed, to_rank(score), jnp.inf))
        target = here.targets[best]
        # An agent that stops goes nowhere: it must not keep a place claimed for the rest of the mission.
        message = jnp.where(here.allowed.any(), target, jnp.nan) if self.shared else self.empty_message()
        return Decision(target[None], message, memory, ~here.allowed.any())
