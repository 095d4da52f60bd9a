"""`greedy` and `shared-greedy`: the neighbour whose measurement would lower Tr(P) most."""

import equinox as eqx
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.planners.lookahead import predicted_trace
from maipp.planners.roadmap_step import Edges, edges_here, roadmap_of
from maipp.planners.roadmap_ways import lengths_from, lengths_to
from maipp.planners.told import count_told
from maipp.simulator.decision import Decision, Observation, Planner, PyTree
from maipp.typing import Array, Float, Index, Key

# Among no-go zones, nodes nearer than this, in measurement intervals, are passed over where there are others.
_APART = 0.1


class Greedy(Planner):
    """One step ahead on the roadmap: the lowest predicted Tr(P) as if measuring at the next node.

    With `shared=True` every agent announces the node it is heading to, and the others count it as measured.
    """

    shared: bool = eqx.field(static=True, default=False)

    uses_roadmap = True
    avoids_obstacles = True

    def empty_message(self) -> PyTree:
        """The announced target: position (2,), NaN before the first decision."""
        return jnp.full(2, jnp.nan, jnp.result_type(float)) if self.shared else ()

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The neighbour with the lowest predicted Tr(P); stops when the budget reaches none."""
        here = edges_here(self.scenario, observation)
        belief = observation.belief
        if self.shared:
            valid = observation.heard & jnp.isfinite(observation.messages[:, 0])
            targets = jnp.where(valid[:, None], observation.messages, 0.0)
            value = self.scenario.virtual_value
            belief = count_told(belief, targets, valid, near=observation.position, virtual_value=value)
        score = predicted_trace(
            belief,
            self.interest,
            observation.inside,
            here.targets[:, None, :],
            here.allowed[:, None],
            virtual_value=self.scenario.virtual_value,
        )
        if self.scenario.obstacles:
            # To and fro between two nodes that all but coincide would fill the agent's record before it gets anywhere.
            apart = here.allowed & (here.lengths > _APART * self.scenario.measurement_interval)
            score = jnp.where(apart | ~apart.any(), score, jnp.inf)
        best = jnp.argmin(jnp.where(here.allowed, score, jnp.inf))
        if self.scenario.obstacles:
            best = self._out_of_traps(observation, belief, here, score, best)
        target = here.targets[best]
        # An agent that stops goes nowhere: it must not keep a place claimed for the rest of the mission.
        message = jnp.where(here.allowed.any(), target, jnp.nan) if self.shared else self.empty_message()
        return Decision(target[None], message, memory, ~here.allowed.any())

    def _out_of_traps(
        self, observation: Observation, belief: Belief, here: Edges, score: Float[Array, " k"], best: Index
    ) -> Index:
        """The best neighbour, or the one on the way to a node farther away that is worth more for its length.

        Among no-go zones the neighbours may all be in a bay that is measured already, and the best of them is then no
        better than any other.
        """
        roadmap, interval = roadmap_of(observation), self.scenario.measurement_interval
        nodes = jnp.asarray(roadmap.nodes)
        now = self.interest.trace(belief.mean, belief.variance, observation.inside)
        after = predicted_trace(
            belief,
            self.interest,
            observation.inside,
            nodes[:, None, :],
            jnp.ones((nodes.shape[0], 1), bool),
            virtual_value=self.scenario.virtual_value,
        )
        length = lengths_from(roadmap, here.node)
        # The node it is on, too, is none to set out for.
        away = (length > _APART * interval) & (length <= observation.remaining)
        rate = jnp.where(away, (now - after) / (length + interval), -jnp.inf)
        goal = jnp.argmax(rate)
        onward = jnp.where(here.allowed, here.lengths + lengths_to(roadmap, goal)[here.target_nodes], jnp.inf)
        leave = rate[goal] > (now - score[best]) / (here.lengths[best] + interval)
        return jnp.where(leave & jnp.isfinite(onward).any(), jnp.argmin(onward), best)
