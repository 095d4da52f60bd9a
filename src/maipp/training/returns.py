"""Advantages and returns of asynchronous agents: each agent's next decision ends its last one."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.engine.reward import final_reward, reward
from maipp.training.config import TrainConfig
from maipp.training.rollout import Transition
from maipp.typing import Array, Bool, Float


class Returns(NamedTuple):
    """What each decision was worth; meaningless where not `valid`."""

    advantage: Float[Array, "t e"]
    target: Float[Array, "t e"]  # what the value should have been
    valid: Bool[Array, "t e"]  # the agent's next decision is known, so it made a choice


class _Next(NamedTuple):
    """Each agent's next decision, going backwards."""

    known: Bool[Array, " m"]
    trace: Float[Array, " m"]
    value: Float[Array, " m"]  # of the situation; at the end of its mission, the reward for the end
    advantage: Float[Array, " m"]


def returns(config: TrainConfig, transitions: Transition, agents: int) -> Returns:
    """Generalised advantage estimates (Schulman et al. 2016), backwards over events with one carry per agent.

    The last decision of each agent whose mission goes on has no known outcome: it is not valid, and its value stands
    for all that follows.
    """

    def back(after: _Next, event: tuple[Array, ...]) -> tuple[_Next, tuple[Array, ...]]:
        agent, trace, value, stopped, ended = event
        # Whoever comes later in this slot belongs to another mission; so an agent that stopped has no next decision.
        after = jax.tree.map(lambda a: jnp.where(ended, jnp.zeros_like(a), a), after)
        known = after.known[agent]
        gain = reward(config.reward, trace, after.trace[agent]) + config.discount * after.value[agent] - value
        advantage = gain + config.discount * config.trace_decay * after.advantage[agent]
        advantage = jnp.where(known, advantage, 0.0)
        worth = jnp.where(stopped, final_reward(config.reward, trace), value)
        here = jnp.arange(agents) == agent
        after = _Next(
            known=after.known | here,
            trace=jnp.where(here, trace, after.trace),
            value=jnp.where(here, worth, after.value),
            advantage=jnp.where(here, advantage, after.advantage),
        )
        return after, (advantage, value + advantage, known)

    def mission(agent: Array, trace: Array, value: Array, stopped: Array, ended: Array) -> tuple[Array, ...]:
        nothing = _Next(jnp.zeros(agents, bool), *(jnp.zeros(agents, value.dtype) for _ in range(3)))
        return lax.scan(back, nothing, (agent, trace, value, stopped, ended), reverse=True)[1]

    columns = (transitions.agent, transitions.trace, transitions.value, transitions.stopped, transitions.ended)
    return Returns(*jax.vmap(mission, in_axes=1, out_axes=1)(*columns))
