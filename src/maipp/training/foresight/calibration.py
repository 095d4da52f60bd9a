"""What is measured on samples that nothing was fitted to: how well a model foretells, how sure it is, what it knows."""

from collections.abc import Iterator
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.foresight.law import Law
from maipp.foresight.model import GROUPS, FieldModel, group_of
from maipp.training.foresight.bank import Routes
from maipp.training.foresight.config import ForesightConfig
from maipp.training.foresight.losses import Scores, foretold, loss_of, scores
from maipp.training.foresight.samples import FittedFamilies, ForesightExample, draw_batch
from maipp.typing import Array, Float

# Worlds of evaluations along the way, and of the calibration at the end; training has `config.seed`.
VALIDATION_SEED, CALIBRATION_SEED = 770_001, 770_002

_BATCH = 64
# Samples of the calibration, to one of an evaluation along the way.
CALIBRATED = 12

# The part of the standard normal within these deviations is 68 and 95 %.
_ONE, _TWO = 0.9945, 1.96

# Factors of deviations that are tried.
_FACTORS = np.linspace(0.5, 2.0, 601)

# Fewer samples of the default scenario than this say less of a group of counts than all samples do.
_ENOUGH = 30

# Part of the training's numbers beyond either end of what the model takes for known, and a margin on top of the rest.
_TAIL, _MARGIN = 5e-4, 0.1


def samples_of(
    config: ForesightConfig, routes: Routes, kinds: FittedFamilies, seed: int, count: int
) -> Iterator[list[ForesightExample]]:
    """At least `count` samples in batches."""
    draw = jax.jit(lambda key: draw_batch(config, routes, kinds, key, _BATCH))
    for number in range(-(-count // _BATCH)):
        yield draw(jax.random.fold_in(jax.random.key(seed), number))


class _Judged(NamedTuple):
    """Of every sample."""

    learned: Scores
    fitted: Scores
    belief: Scores
    usual: Array
    count: Array


@eqx.filter_jit
def _judged(model: FieldModel, batch: ForesightExample) -> _Judged:
    def one(sample: ForesightExample) -> _Judged:
        learned, fitted, belief = (
            scores(law, sample) for law in (foretold(model, sample), sample.fitted, sample.belief)
        )
        return _Judged(learned, fitted, belief, sample.usual, sample.count)

    return jax.vmap(one)(batch)


def evaluation(model: FieldModel, batches: list[list[ForesightExample]], config: ForesightConfig) -> dict[str, float]:
    """Loss, and mean scores of the model and of what it corrects; `usual_...` those of the default scenario alone."""
    rows = [_judged(model, part) for batch in batches for part in batch]
    all_rows = jax.tree.map(lambda *arrays: np.concatenate([np.asarray(a) for a in arrays]), *rows)
    values: dict[str, float] = {}
    for name, keep in (("", np.ones_like(all_rows.usual)), ("usual_", all_rows.usual)):
        if not keep.any():
            continue
        for who in ("learned", "fitted", "belief"):
            each: Scores = getattr(all_rows, who)
            values[f"{name}{who}_rmse"] = float(np.sqrt(each.squared[keep]).mean())
            values[f"{name}{who}_nll"] = float(each.nll[keep].mean())
            values[f"{name}{who}_area"] = float(each.area[keep].mean())
    means: Scores = jax.tree.map(np.mean, all_rows.learned)
    values["loss"] = float(loss_of(means, config))
    return values


def calibrated(model: FieldModel, batches: Iterator[list[ForesightExample]]) -> FieldModel:
    """The model with deviations as wide as its errors by measurement counts, and with the range of what it was told.

    As wide as in samples of the default scenario, where there are enough of them.
    """

    @jax.jit
    def row(part: ForesightExample) -> tuple[Array, Array, Array, Array]:
        laws: Law = jax.vmap(lambda sample: foretold(model, sample))(part)
        return jnp.abs(part.truth - laws.mean) / laws.deviation, part.numbers, part.count, part.usual

    rows = [jax.device_get(row(part)) for batch in batches for part in batch]
    numbers, counts, usual = (np.concatenate([each[i] for each in rows]) for i in (1, 2, 3))
    group = np.asarray(group_of(jnp.asarray(counts)))
    errors = np.concatenate([each[0] for each in rows])
    own = [usual & (group == k) for k in range(GROUPS)]
    picked = [mask if mask.sum() >= _ENOUGH else group == k for k, mask in enumerate(own)]
    widening = np.array([_widening(errors[mask]) for mask in picked], np.float32)
    bounds = np.stack([_range(numbers[group == k]) for k in range(GROUPS)])
    low, high = (jnp.asarray(bounds[:, end], jnp.float32) for end in (0, 1))
    return eqx.tree_at(lambda m: (m.widening, m.low, m.high), model, (jnp.asarray(widening), low, high))


def _widening(errors: Float[np.ndarray, "s q"]) -> float:
    """The factor that makes the larger miss, of 68 % within one width or of 95 % within the other, smallest.

    Errors have heavier tails than a normal law: no factor hits both. 1 without data.
    """
    if not errors.size:
        return 1.0
    parts = [np.searchsorted(np.sort(errors, axis=None), width * _FACTORS) / errors.size for width in (_ONE, _TWO)]
    off = np.maximum(np.abs(parts[0] - 0.68), np.abs(parts[1] - 0.95))
    return float(_FACTORS[np.argmin(off)])


def _range(numbers: Float[np.ndarray, "s g"]) -> Float[np.ndarray, "2 g"]:
    """Ends of the range, a little wider than what all but a few samples were told; nothing without samples."""
    if not len(numbers):
        most = np.full(numbers.shape[1], np.finfo(np.float32).max)
        return np.stack([most, -most])
    low, high = np.quantile(numbers, _TAIL, axis=0), np.quantile(numbers, 1.0 - _TAIL, axis=0)
    margin = _MARGIN * (high - low) + 1e-3
    return np.stack([low - margin, high + margin])
