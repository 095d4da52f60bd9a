"""What a foresight is trained to make small."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import log_ndtr

from maipp.foresight.law import Law
from maipp.foresight.model import FieldModel
from maipp.training.foresight.config import ForesightConfig
from maipp.training.foresight.samples import ForesightExample, interpolated
from maipp.typing import Array, Float

# Deviation below which nobody asks how sure the foresight is, field units: fields lie between 0 and 1.
_LEAST = 2e-3


class Scores(NamedTuple):
    """How well laws foretell, means over points."""

    nll: Float[Array, "*b"]  # negative log likelihood of the truth, nats
    area: Float[Array, "*b"]  # log loss of being of high interest, weighted by the belief's variance
    squared: Float[Array, "*b"]  # squared error, field units squared
    relative: Float[Array, "*b"]  # the same, in units of the fitted foresight's variance


def scores(law: Law, sample: ForesightExample) -> Scores:
    """Of one sample without batch axes."""
    deviation = jnp.sqrt(law.deviation**2 + _LEAST**2)
    off = (sample.truth - law.mean) / deviation
    nll = 0.5 * off * off + jnp.log(deviation) + 0.5 * jnp.log(2.0 * jnp.pi)
    above = (law.mean - sample.threshold) / deviation
    high = sample.truth >= sample.threshold
    variance = sample.belief.deviation**2
    weight = variance / jnp.maximum(jnp.mean(variance), 1e-9)
    # A log loss is without bounds, and a truth of which a law was certain otherwise would be all that counts.
    area = -jnp.maximum(log_ndtr(jnp.where(high, above, -above)), -8.0)
    squared = jnp.mean((sample.truth - law.mean) ** 2)
    relative = squared / (jnp.mean(sample.fitted.deviation**2) + _LEAST**2)
    return Scores(jnp.mean(nll), jnp.mean(weight * area), squared, relative)


def foretold(model: FieldModel, sample: ForesightExample) -> Law:
    """The law that the model's network gives for one sample, neither widened nor doubted."""
    return interpolated(*model.network(sample.maps, sample.numbers), sample)


def loss_of(scores: Any, config: ForesightConfig) -> Any:
    """The loss whose parts these scores are."""
    return scores.nll + config.area * scores.area + config.squared * scores.relative


def batch_loss(
    model: FieldModel, batch: list[ForesightExample], config: ForesightConfig
) -> tuple[Float[Array, ""], Scores]:
    """The mean loss of a batch, and its scores."""
    parts = [jax.vmap(lambda sample: scores(foretold(model, sample), sample))(part) for part in batch]
    means = Scores(*(jnp.mean(jnp.concatenate(rows)) for rows in zip(*parts, strict=True)))
    return loss_of(means, config), means
