"""One sample: a field drawn afresh, measured along a route of the bank, and what a network is told of it."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32, condition
from maipp.foresight.bump_moments import bumps_of
from maipp.foresight.bumps import Bumps
from maipp.foresight.features import Rules, between
from maipp.foresight.fitted import ODDS
from maipp.foresight.law import Law
from maipp.foresight.learned import told
from maipp.foresight.model import CELLS
from maipp.foresight.own_kernel import own_kernel
from maipp.foresight.weighed import averaged
from maipp.scenario import Scenario
from maipp.training.foresight.bank import Routes
from maipp.training.foresight.config import ForesightConfig
from maipp.training.foresight.fields import (
    Families,
    draw_bumps,
    draw_process,
    families_of,
    family_scenarios,
    most_bumps,
)
from maipp.training.worlds import turned
from maipp.typing import Array, Float, Index, Int, Key

# Samples with room for no more measurements are not drawn apart from those with more.
_FEW = 40

# Part of the samples whose agent knows only some of what the team has measured, as with radios of limited range.
_PARTLY = 0.15


class FittedFamilies(NamedTuple):
    """The families of bumps, and the fitted process of each (leading axis f)."""

    families: Families
    bumps: Bumps


class ForesightExample(NamedTuple):
    """What a network is told, and what it should have said, at q points that are no points of the lattice."""

    maps: Float[Array, "*b h w c"]
    numbers: Float[Array, "*b g"]
    count: Int[Array, "*b"]  # measurements
    points: Float[Array, "*b q 2"]  # domain units
    extent: Float[Array, "*b 2"]
    truth: Float[Array, "*b q"]  # field units
    fitted: Law
    belief: Law  # the protocol's mean and deviation
    threshold: Float[Array, "*b"]
    usual: Array  # whether kind of field and numbers are the default scenario's


def kinds(config: ForesightConfig) -> FittedFamilies:
    """The families that the configuration draws from, and what is fitted to each; it takes a second or two."""
    scenarios = family_scenarios()[: 1 if config.benchmark == 1.0 else None]
    bumps = [bumps_of(each) for each in scenarios]
    return FittedFamilies(families_of(scenarios), jax.tree.map(lambda *rows: jnp.stack(rows), *bumps))


def draw_batch(
    config: ForesightConfig, routes: Routes, kinds: FittedFamilies, key: Key, size: int
) -> list[ForesightExample]:
    """A batch in parts, each of samples of one size: bumps with few and with many measurements, and processes."""
    processes = round(size * config.processes)
    few = (size - processes) // 2 if config.slots > _FEW else 0
    fewer = max(config.slots * 2 // 5, 1)
    parts = ((few, fewer, False), (size - processes - few, config.slots, False), (processes, fewer, True))
    batch = []
    for number, (count, slots, process) in enumerate(parts):
        if count:
            keys = jax.random.split(jax.random.fold_in(key, number), count)
            batch.append(jax.vmap(partial(_sample, config, routes, kinds, slots, process))(keys))
    return batch


def _sample(
    config: ForesightConfig, routes: Routes, kinds: FittedFamilies, slots: int, process: bool, key: Key
) -> ForesightExample:
    keys = iter(jax.random.split(key, 16))
    default = Scenario()
    usual = jnp.asarray(False) if process else jax.random.bernoulli(next(keys), config.benchmark)
    # The routes of surveys with the default length scale, or any.
    scales = jnp.asarray(routes.length_scale)
    fitting = jnp.where(usual, jnp.abs(scales - default.length_scale) < 1e-6, True)
    row = jax.random.categorical(next(keys), jnp.where(fitting, 0.0, -jnp.inf))
    length_scale = scales[row]

    def drawn(ends: tuple[float, float], default: float) -> Array:
        return jnp.where(usual, default, jax.random.uniform(next(keys), (), minval=ends[0], maxval=ends[1]))

    family = jnp.where(usual, 0, jax.random.randint(next(keys), (), 0, kinds.bumps.level.shape[0]))
    threshold = drawn(config.threshold, default.threshold)
    logarithms = float(np.log(config.noise[0])), float(np.log(config.noise[1]))
    noise = jnp.exp(drawn(logarithms, float(np.log(default.noise))))
    extent = kinds.families.extent[family]
    bumps = jax.tree.map(lambda rows: rows[family], kinds.bumps)
    if process:
        field: Any = draw_process(next(keys))
        length_scale = field.length_scale * jnp.exp(0.3 * jax.random.normal(next(keys)))
        length_scale = jnp.clip(length_scale, *config.length_scale)
        # About the same part of any field is of high interest.
        threshold = field.level + field.scale * jax.random.uniform(next(keys), (), minval=-0.5, maxval=1.5)
    else:
        field = draw_bumps(next(keys), kinds.families, family, most_bumps())
    x, mask = _measured(routes, row, slots, next(keys))
    x = turned(jax.random.randint(next(keys), (), 0, 8), x) * extent
    y = field(x) + jnp.sqrt(noise) * jax.random.normal(next(keys), (slots,))
    places = _places(next(keys), CELLS) * extent[:, None]
    points = jnp.stack(jnp.meshgrid(places[0], places[1], indexing="ij"), axis=-1).reshape(-1, 2)
    belief = condition(Matern32(length_scale, 1.0), x, y, mask, points, noise)
    factor = bumps.factored(belief, extent)
    maps, numbers = told(Rules(threshold, length_scale, jnp.ones(()), extent), bumps, belief, CELLS, factor)
    fitted = averaged(bumps.given(belief, extent, CELLS, factor), own_kernel(belief), ODDS)
    return ForesightExample(
        maps,
        numbers,
        jnp.sum(mask),
        points,
        extent,
        field(points),
        fitted,
        Law(belief.mean, belief.std),
        threshold,
        usual,
    )


def _measured(routes: Routes, row: Index, slots: int, key: Key) -> tuple[Float[Array, "n 2"], Array]:
    """The measurements of a route until a time that is drawn, the last `slots` of the first so many."""
    until_key, thin_key, share_key = jax.random.split(key, 3)
    x, count = jnp.asarray(routes.x)[row, :slots], jnp.minimum(jnp.asarray(routes.count)[row], slots)
    until = jax.random.randint(until_key, (), 0, count + 1)
    least = jnp.where(jax.random.bernoulli(share_key, _PARTLY), 0.3, 1.0)
    share = jax.random.uniform(share_key, (), minval=least, maxval=1.0)
    kept = jax.random.uniform(thin_key, (slots,)) <= share
    return x, (jnp.arange(slots) < until) & kept


def _places(key: Key, cells: int) -> Float[Array, "2 c"]:
    """Coordinates along both axes, one at random in each of `cells` parts; unit square."""
    return (jnp.arange(cells) + jax.random.uniform(key, (2, cells))) / cells


def interpolated(shift: Float[Array, "h w"], stretch: Float[Array, "h w"], sample: ForesightExample) -> Law:
    """The law of a sample (without batch axes), corrected by these."""
    at = [between(each, sample.points, sample.extent) for each in (shift, stretch)]
    return Law(sample.fitted.mean + sample.fitted.deviation * at[0], sample.fitted.deviation * jnp.exp(at[1]))
