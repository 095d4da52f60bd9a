"""A law and how well what it was made of explains the measurements."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.foresight.law import Law
from maipp.typing import Array, Float


class Weighed(NamedTuple):
    """The law that a model of the field gives after measurements."""

    law: Law
    evidence: Float[Array, ""]  # logarithm of how likely the model made the measured values


def mixed(models: Sequence[Weighed]) -> Weighed:
    """The law of a field that is of one of these models, alike likely beforehand, as far as the measurements tell."""
    evidence = jnp.stack([model.evidence for model in models])
    laws = jax.tree.map(lambda *arrays: jnp.stack(arrays), *(model.law for model in models))
    weight = jax.nn.softmax(jnp.nan_to_num(evidence, nan=-jnp.inf, neginf=-1e9))[:, None]
    mean = jnp.sum(weight * laws.mean, axis=0)
    spread = laws.deviation**2 + (laws.mean - mean) ** 2
    total = jax.nn.logsumexp(evidence) - jnp.log(len(models))
    return Weighed(Law(mean, jnp.sqrt(jnp.sum(weight * spread, axis=0))), total)


def averaged(one: Weighed, other: Weighed, odds: float) -> Law:
    """The law of a field that is of either model, as far as the measurements tell.

    `odds` is the logarithm of how much more likely the first was before. Mean and deviation are those of the mixture
    (Hoeting et al. 1999, "Bayesian model averaging").
    """
    weight = jax.nn.sigmoid(jnp.nan_to_num(one.evidence - other.evidence, nan=0.0) + odds)
    mean = weight * one.law.mean + (1.0 - weight) * other.law.mean
    apart = one.law.mean - other.law.mean
    inner = weight * one.law.deviation**2 + (1.0 - weight) * other.law.deviation**2
    return Law(mean, jnp.sqrt(inner + weight * (1.0 - weight) * apart * apart))
