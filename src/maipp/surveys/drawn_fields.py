"""Fields as likely as a mission or scenario has them, to rehearse on and to simulate vehicles in."""

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32
from maipp.fields.gp_field import PosteriorField, draw_fields
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey
from maipp.typing import Key

# Mixed into the seed, so that the drawn fields share no key with the starts and the planners.
_STREAM = 0x5F1E1D


def drawn_fields(mission: PreparedSurvey | Scenario, count: int, seed: int, spread: float = 0.0) -> PosteriorField:
    """`count` fields drawn from the kernel and the old samples, if any: standardised values, domain units.

    One pytree with a leading axis. `spread` is the standard deviation of the length scale's logarithm; without it,
    field i of a seed is the same whatever the count.
    """
    if isinstance(mission, Scenario):
        scenario, x, y, noise = mission, None, None, 0.0
    else:
        (x, y), scenario, noise = mission.prior or (None, None), mission.scenario, mission.prior_noise
    key = jax.random.fold_in(jax.random.key(seed), _STREAM)

    def drawn(length_scale: float, key: Key, count: int) -> PosteriorField:
        return draw_fields(key, Matern32(length_scale, scenario.signal_variance), count, x=x, y=y, noise=noise)

    if not spread:
        return drawn(scenario.length_scale, key, count)
    scales = scenario.length_scale * np.exp(spread * np.random.default_rng([seed, _STREAM]).normal(size=count))
    each = [drawn(float(scale), jax.random.fold_in(key, index), 1) for index, scale in enumerate(scales)]
    return jax.tree.map(lambda *arrays: jnp.concatenate(arrays), *each)
