"""What the network of the learned foresight is told: maps on its lattice, and numbers of the whole.

All of it is standardised by mean and deviation that fields of the family have before anything is measured.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax.scipy.special import ndtr

from maipp.belief import Belief
from maipp.foresight.law import Law
from maipp.typing import Array, Extent, Float, Real

MAPS = (
    "fitted mean",
    "fitted deviation",
    "its logarithm",
    "protocol mean",
    "protocol deviation",
    "probability of high interest",
    "density of measurements",
    "values nearby",
    "distance to the nearest measurement",
    "ones",
)
NUMBERS = (
    "measurements",
    "largest value",
    "least value",
    "mean value",
    "largest fitted mean",
    "threshold",
    "length scale",
    "noise",
    "field mean",
    "field deviation",
    "field width",
    "extent x",
    "extent y",
    "signal variance",
    "score of the family",
    "score of the kernel",
    "odds of the family",
)
_FARTHEST = 0.5  # distances beyond this are alike, domain units
_LEAST = 1e-3  # deviation, in units of the field's


class Family(NamedTuple):
    """What fields of the family are before anything is measured."""

    mean: Real  # field units
    deviation: Real
    width: Real  # of what they are made of, domain units


class Rules(NamedTuple):
    """The numbers of a survey that matter."""

    threshold: Real  # field units
    length_scale: Real  # of the belief's kernel, domain units
    signal_variance: Real  # likewise, field units squared
    extent: Extent


class Foretold(NamedTuple):
    """What the fitted foresight and the protocol's belief say at the q points of the lattice."""

    fitted: Law
    mean: Float[Array, " q"]  # the belief's
    deviation: Float[Array, " q"]
    family_evidence: Float[Array, ""]  # logarithm of how likely the family made the measured values
    kernel_evidence: Float[Array, ""]  # the same of the belief's kernel


def features(
    family: Family, rules: Rules, belief: Belief, told: Foretold, lattice: Float[Array, "q 2"]
) -> tuple[Float[Array, "q c"], Float[Array, " g"]]:
    """The maps at the points of a lattice, columns as in `MAPS`, and the numbers, as in `NUMBERS`."""
    mask, unit = belief.mask, family.deviation

    def standard(value: Array | Real) -> Array:
        return jnp.asarray((value - family.mean) / unit)

    fitted, value = told.fitted, jnp.where(mask, standard(belief.y), 0.0)
    offset = lattice[:, None] - belief.x
    squared = jnp.where(mask, jnp.sum(offset * offset, axis=-1), 4.0 * _FARTHEST**2)
    # As wide as the lattice is fine.
    spacing = jnp.max(jnp.asarray(rules.extent)) / (lattice.shape[0] ** 0.5 - 1.0)
    near = jnp.where(mask, jnp.exp(-0.5 * squared / spacing**2), 0.0)
    density = jnp.sum(near, axis=1)
    nearest = jnp.sqrt(jnp.min(squared, axis=1, initial=4.0 * _FARTHEST**2))
    share = jnp.maximum(fitted.deviation / unit, _LEAST)
    maps = (
        standard(fitted.mean),
        share,
        jnp.log(share) / 3.0,
        standard(told.mean),
        told.deviation,
        ndtr((fitted.mean - rules.threshold) / (share * unit)),
        jnp.minimum(density, 3.0),
        (near @ value) / (density + 0.1),
        jnp.minimum(nearest, _FARTHEST) / _FARTHEST,
        jnp.ones_like(nearest),
    )
    count = jnp.sum(mask)
    some = jnp.maximum(count, 1)
    numbers = (
        jnp.log1p(count) / 3.0,
        jnp.where(count > 0, jnp.max(value, where=mask, initial=-9.0), 0.0),
        jnp.where(count > 0, jnp.min(value, where=mask, initial=9.0), 0.0),
        jnp.sum(value) / some,
        jnp.max(standard(fitted.mean)),
        standard(rules.threshold),
        jnp.log(rules.length_scale / 0.45),
        jnp.log(jnp.maximum(belief.noise / unit**2, 1e-5)) / 5.0 + 1.0,
        family.mean / unit,
        jnp.log(unit / 0.25),
        jnp.log(family.width / 0.1),
        jnp.log(rules.extent[0]),
        jnp.log(rules.extent[1]),
        jnp.log(rules.signal_variance),
        (told.family_evidence / some + jnp.where(count > 0, jnp.log(unit), 0.0)) / 2.0,
        (told.kernel_evidence / some + jnp.where(count > 0, jnp.log(unit), 0.0)) / 2.0,
        jnp.clip((told.family_evidence - told.kernel_evidence) / 10.0, -3.0, 3.0),
    )
    return jnp.stack(maps, axis=-1), jnp.stack([jnp.asarray(each, value.dtype) for each in numbers])


def lattice_points(cells: int, extent: Extent) -> Float[Array, "q 2"]:
    """The network's lattice: `cells` points a side, both ends included, x slowest (domain units)."""
    place = jnp.linspace(0.0, 1.0, cells)
    return jnp.stack(jnp.meshgrid(place, place, indexing="ij"), axis=-1).reshape(-1, 2) * jnp.asarray(extent)


def between(lattice: Float[Array, "h w"], points: Float[Array, "p 2"], extent: Extent) -> Float[Array, " p"]:
    """Values on the lattice at any points, bilinear in between; beyond the domain those of its border."""
    shape = jnp.asarray(lattice.shape)
    place = jnp.clip(points / jnp.asarray(extent), 0.0, 1.0) * (shape - 1)
    low = jnp.clip(jnp.floor(place).astype(jnp.int32), 0, shape - 2)
    (u, v), (i, j) = (place - low).T, low.T
    row = lattice[i, j] * (1 - v) + lattice[i, j + 1] * v
    return row * (1 - u) + (lattice[i + 1, j] * (1 - v) + lattice[i + 1, j + 1] * v) * u
