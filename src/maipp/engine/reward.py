"""What a decision and the end of a mission are worth to an agent: Yang et al. 2023, Sec. IV-C, and one that sums up."""

from typing import Literal

import jax.numpy as jnp

from maipp.typing import Array, Float

# "paper": the relative drop of Tr(P), and a price for what is left at the end. "log-trace": the drop of log Tr(P).
RewardKind = Literal["paper", "log-trace"]

# Weight of the final trace in the paper's reward.
_FINAL = 0.02
# Traces below this count as this, so that what is left of nothing is worth nothing.
_LEAST_TRACE = 1e-3


def reward(
    kind: RewardKind, before: Float[Array, "..."] | float, after: Float[Array, "..."] | float
) -> Float[Array, "..."]:
    """For one decision, from Tr(P) of the agent's own belief when it was taken to that at the agent's next one.

    The rewards of "log-trace" sum to that of the whole mission.
    """
    if kind == "log-trace":
        return jnp.log(jnp.maximum(before, _LEAST_TRACE)) - jnp.log(jnp.maximum(after, _LEAST_TRACE))
    return (before - after) / jnp.maximum(before, _LEAST_TRACE)


def final_reward(kind: RewardKind, trace: Float[Array, "..."] | float) -> Float[Array, "..."]:
    """For the end of an agent's mission: -0.02 Tr(P_f) in the paper, nothing where the rewards sum to it anyway."""
    return -_FINAL * jnp.asarray(trace) if kind == "paper" else jnp.zeros_like(trace)
