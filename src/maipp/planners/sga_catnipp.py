"""`sga-catnipp`: the policy without intents; agents plan in sequence, counting the others' next nodes as measured.

Source: Cao et al. 2022 (CAtNIPP); Yang et al. 2023, Sec. V (sequential greedy assignment baseline, greedy variant).
"""

from typing import Literal

import jax
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Decision, Observation, PyTree, option
from maipp.planners.policy_planner import Choice, PolicyPlanner
from maipp.planners.roadmap_step import roadmap_of
from maipp.planners.told import count_targets, no_target
from maipp.typing import Key


class SgaCatnipp(PolicyPlanner):
    """Moves by a policy that knows no intents, on a belief in which the announced next nodes count as measured."""

    weights: str = option("sga-catnipp", meaning="shipped weights, a .safetensors file, or untrained")
    choose: Literal["likeliest", "sample"] = option("likeliest", meaning="the next node")

    def empty_message(self) -> PyTree:
        """The announced next node: position (2,), NaN before the first decision."""
        return no_target()

    def counted(self, observation: Observation) -> Belief:
        """The due agent's belief with the others' announced next nodes counted as measured."""
        return count_targets(observation, self.scenario.virtual_value)

    def act(self, key: Key, observation: Observation, memory: PyTree) -> tuple[Decision, Choice]:
        """The next node, announced, and what a trainer needs to know of the decision."""
        nodes = jnp.asarray(roadmap_of(observation).nodes)
        situation = self.situation(observation, self.counted(observation), jnp.zeros(nodes.shape[0], nodes.dtype))
        insight = self.look(situation, memory)
        stop = ~insight.view.allowed.any()
        logits = jnp.where(stop, 0.0, insight.logits)
        if self.choose == "sample":
            index = jax.random.categorical(key, logits / self.temperature).astype(jnp.int32)
        else:
            index = jnp.argmax(logits).astype(jnp.int32)
        target = nodes[insight.view.neighbours[index]]
        decision = Decision(target[None], jnp.where(stop, jnp.nan, target), insight.memory, stop)
        return decision, Choice(situation, insight, memory, index)
