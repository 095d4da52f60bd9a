"""What training minimises: the distance from the teacher at first, then PPO's clipped objective."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.planners.paths.path_sampler import log_probability
from maipp.policy import PolicyNetwork, Prepared
from maipp.training.config import TrainConfig
from maipp.training.rollout import Phase, Transition
from maipp.training.search import surprise
from maipp.training.worlds import Bank
from maipp.typing import Array, Bool, Float


class PolicyExample(NamedTuple):
    """A decision with what it turned out to be worth."""

    transition: Transition
    advantage: Float[Array, ""]  # normalised
    target: Float[Array, ""]
    valid: Bool[Array, ""]


def ask(
    network: PolicyNetwork, bank: Bank, transition: Transition
) -> tuple[Prepared, Float[Array, " k"], Float[Array, ""]]:
    """What the network makes of the situation of a transition: its encoding, logits and value."""
    assert bank.roadmap.encoding is not None
    encoding = bank.roadmap.encoding[transition.roadmap, transition.agent] * transition.signs
    prepared = network.prepare(network.encode(transition.features, encoding))
    logits, value, _ = network.decode(
        prepared,
        transition.node,
        transition.neighbours,
        transition.allowed,
        transition.neighbour_std,
        transition.remaining,
        transition.threshold,
        transition.memory,
    )
    return prepared, logits, value


def sample_loss(
    config: TrainConfig, network: PolicyNetwork, bank: Bank, sample: PolicyExample, phase: Phase
) -> tuple[Float[Array, ""], dict[str, Array]]:
    """Loss of one decision, and its parts: those that mean something in this phase.

    Imitation is the cross-entropy from the teacher's choice; search that from the steps of the elite paths; PPO as in
    Schulman et al. 2017, with an entropy bonus. The value is fitted in all. How far the policy moved (`kl`) and whether
    PPO clipped are told in `reinforce` alone: the other phases do not follow the gradient of the ratio.
    """
    transition = sample.transition
    prepared, logits, value = ask(network, bank, transition)
    acts = transition.allowed.any()
    # Where nothing is allowed any distribution will do: it has no weight, and must have no NaN.
    logs = jax.nn.log_softmax(jnp.where(acts, logits, 0.0))
    finite = jnp.where(transition.allowed, logs, 0.0)
    chances = jnp.where(transition.allowed, jnp.exp(finite), 0.0)
    entropy = -jnp.sum(chances * finite)
    weight = sample.valid.astype(jnp.float32)
    error = weight * 0.5 * (value - sample.target) ** 2
    parts = {"value_loss": error, "entropy": entropy * acts}
    if phase == "reinforce":
        ratio_log = jnp.where(sample.valid, log_probability(logits, transition.index) - transition.log_probability, 0.0)
        ratio = jnp.exp(ratio_log)
        clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
        policy = -weight * jnp.minimum(ratio * sample.advantage, clipped * sample.advantage)
        parts |= {
            "policy_loss": policy,
            "kl": weight * (ratio - 1 - ratio_log),
            "clip_fraction": weight * (jnp.abs(ratio - 1) > config.clip),
        }
        loss = policy - config.entropy * parts["entropy"]
    else:
        if transition.elites is None:
            loss = -jnp.sum(transition.lesson * finite)
        else:
            loss = surprise(network, prepared, transition.memory, transition.threshold, transition.elites)
        parts["imitation_loss"] = loss
    loss += config.value * error
    return loss, {"loss": loss, **parts}
