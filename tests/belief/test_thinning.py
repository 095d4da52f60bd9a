"""Thinning: the spacing is that of a farthest-point order, and what tells of a place are its surroundings."""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maipp.belief.thinning import most_telling, spacing

SEEDS = st.integers(0, 2**32 - 1)
COUNT = 40

spacing_ = jax.jit(spacing)
telling_ = jax.jit(most_telling, static_argnames="count")


def draw(seed):
    """Positions, some of them twice, and which of them hold a measurement."""
    rng = np.random.default_rng(seed)
    x = rng.random((COUNT, 2))
    x[rng.integers(COUNT, size=4)] = x[rng.integers(COUNT, size=4)]
    return jnp.asarray(x, jnp.float32), jnp.asarray(rng.random(COUNT) < 0.8)


@given(SEEDS)
def test_measurements_of_a_spacing_are_that_far_apart_and_leave_no_larger_gap(seed):
    x, mask = draw(seed)
    spaced, x, mask = np.asarray(spacing_(x, mask)), np.asarray(x), np.asarray(mask)
    assert (spaced[~mask] == 0).all()
    distance = np.linalg.norm(x[:, None] - x[None], axis=-1)
    for least in np.quantile(spaced[mask], [0.2, 0.5, 0.8]):
        kept = np.flatnonzero(mask & (spaced > least))
        if len(kept) < 2:
            continue
        assert distance[np.ix_(kept, kept)][~np.eye(len(kept), dtype=bool)].min() >= least - 1e-6
        assert distance[np.ix_(np.flatnonzero(mask), kept)].min(axis=1).max() <= least + 1e-6


def test_one_measurement_has_no_others_to_be_far_from():
    assert float(jnp.max(spacing_(jnp.full((COUNT, 2), 0.3), jnp.arange(COUNT) == 7))) == 0.0
    np.testing.assert_array_equal(spacing_(jnp.full((COUNT, 2), 0.3), jnp.zeros(COUNT, bool)), 0.0)


@given(SEEDS)
def test_all_that_is_known_tells_most_and_masked_slots_come_last(seed):
    x, mask = draw(seed)
    corner = jnp.asarray([0.5, 0.5])
    known = int(mask.sum())
    index = np.asarray(telling_(x, mask, spacing_(x, mask), corner, corner, 0.1, count=COUNT))
    np.testing.assert_array_equal(np.sort(index), np.arange(COUNT))
    assert np.asarray(mask)[index[:known]].all()


def test_near_measurements_are_kept_and_far_ones_thinned():
    side = np.linspace(0, 1, 21)
    x = jnp.asarray(np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2), jnp.float32)
    mask = jnp.ones(len(x), bool)
    corner = jnp.zeros(2)
    index = telling_(x, mask, spacing_(x, mask), corner, corner, 0.1, count=100)
    distance = np.linalg.norm(np.asarray(x), axis=1)
    kept = np.isin(np.arange(len(x)), np.asarray(index))
    shares = [kept[(distance >= low) & (distance < low + 0.25)].mean() for low in (0, 0.25, 0.5, 0.75)]
    assert shares[0] > 0.9 and shares == sorted(shares, reverse=True) and shares[3] > 0
