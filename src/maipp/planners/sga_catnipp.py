"""`sga-catnipp`: the policy without intents; agents plan in sequence, counting the others' next nodes as measured.

Source: Cao et al. 2022 (CAtNIPP); Yang et al. 2023, Sec. V (sequential greedy assignment baseline, greedy variant).
"""

from typing import Literal

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option, part
from maipp.planners.announced.announced_measurements import count_targets, no_target
from maipp.planners.paths.path_sampler import Choice, PathSampler
from maipp.planners.roadmap.edges import roadmap_of
from maipp.typing import Key


class SgaCatnipp(Planner):
    """Moves by a policy that knows no intents, on a belief in which the announced next nodes count as measured."""

    sampler: PathSampler = part(PathSampler, weights="sga-catnipp")
    choose: Literal["likeliest", "sample"] = option("likeliest", meaning="the next node")

    uses_roadmap = True
    avoids_obstacles = True

    def empty_message(self) -> PyTree:
        """The announced next node: position (2,), NaN before the first decision."""
        return no_target()

    def initial_memory(self) -> PyTree:
        """The network's memory of the executed trajectory."""
        return self.sampler.policy.initial_memory()

    def counted(self, observation: Observation) -> Belief:
        """The due agent's belief with the others' announced next nodes counted as measured."""
        return count_targets(observation, self.scenario.virtual_value)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next node, announced."""
        return self.act(key, observation, memory)[0]

    def act(self, key: Key, observation: Observation, memory: PyTree) -> tuple[Decision, Choice]:
        """The decision, and what a trainer needs to know of it."""
        nodes = jnp.asarray(roadmap_of(observation).nodes)
        nobody = jnp.zeros(nodes.shape[0], nodes.dtype)
        situation = self.sampler.agent_state(observation, self.counted(observation).on(nodes), nobody)
        insight = self.sampler.look(situation, memory)
        index = self.sampler.choose(key, insight, sampled=self.choose == "sample")
        target = nodes[insight.view.neighbours[index]]
        message = jnp.where(insight.stuck, jnp.nan, target)
        return Decision(target[None], message, insight.memory, insight.stuck), Choice(situation, insight, memory, index)
