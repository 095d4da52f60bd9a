"""Factors that float32 must make: duplicates, values and variances of any scale, and what cannot be factored."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.belief import Matern32, condition
from tests.belief.slots import (
    KERNEL,
    LENGTH_SCALE,
    NEW,
    QUERY,
    SEEDS,
    SLOTS,
    belief_of,
    condition_,
    draw,
    exact,
    extend_,
    on_,
)


@pytest.mark.parametrize("noise", [1e-6, 1e-10, 0.0])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-6, 1e-4])
def test_near_duplicates_stay_finite_in_float32(gap, noise):
    """A robot that stands still measures the same spot again and again."""
    rng = np.random.default_rng(3)
    count = 30
    at = np.array([0.4, 0.6])
    x = np.concatenate([at + gap * rng.normal(size=(count, 2)), [[0.1, 0.1], [0.9, 0.2]]]).astype(np.float32)
    y = np.concatenate([np.full(count, 0.8), [0.2, 0.5]]).astype(np.float32)
    query = np.concatenate([QUERY, x[-3:]]).astype(np.float32)
    belief = condition_(KERNEL, *map(jnp.asarray, (x, y, np.ones(count + 2, bool), query)), noise=jnp.asarray(noise))
    for leaf in jax.tree.leaves(eqx.filter(belief, eqx.is_array)):
        assert np.isfinite(leaf).all()
    assert (np.asarray(belief.variance) >= 0).all()
    assert (np.asarray(belief.variance) <= 1).all()
    np.testing.assert_allclose(belief.mean[-3:], y[-3:], atol=0.02)
    assert (np.asarray(belief.variance[-3:]) < 0.01).all()
    mean, variance = exact(*(a.astype(np.float64) for a in (x, y, query)), noise=float(belief.noise))
    np.testing.assert_allclose(belief.mean, mean, atol=0.02)
    np.testing.assert_allclose(belief.variance, variance, atol=0.01)


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-6, 1e-4])
def test_near_duplicates_one_more_at_a_time_stay_finite_in_float32(gap):
    rng = np.random.default_rng(4)
    at = np.array([0.4, 0.6])
    x = at + gap * rng.normal(size=(SLOTS, 2))
    # Both the belief that measures there over and over, and a look-ahead that stands still.
    for count in range(3, SLOTS + 1):
        belief = belief_of(x, np.full(SLOTS, 0.8), np.arange(SLOTS) < count)
        more = extend_(
            belief, jnp.asarray(np.tile(at, (NEW, 1)), jnp.float32), jnp.ones(NEW, bool), virtual_value="mean"
        )
        for b in (belief, more):
            there = on_(b, jnp.asarray(at, jnp.float32)[None])
            assert np.isfinite(b.mean).all() and np.isfinite(b.variance).all(), count
            assert (np.asarray(b.variance) >= 0).all() and (np.asarray(b.variance) <= 1).all()
            assert float(there.mean[0]) == pytest.approx(0.8, abs=0.02)
            assert 0 <= float(there.variance[0]) < 0.01


def test_condition_under_vmap_keeps_each_missions_own_nugget():
    """One mission with duplicates must not change the nugget, and so the result, of the mission beside it."""
    rng = np.random.default_rng(5)
    good, y = rng.random((SLOTS, 2)).astype(np.float32), rng.normal(size=SLOTS).astype(np.float32)
    x = jnp.asarray(np.stack([good, np.full_like(good, 0.5)]))
    batched = jax.jit(jax.vmap(partial(condition, KERNEL), in_axes=(0, None, None, None, None)))
    beliefs = batched(x, jnp.asarray(y), jnp.ones(SLOTS, bool), jnp.asarray(QUERY, jnp.float32), jnp.asarray(0.0))
    alone = belief_of(good, y, np.ones(SLOTS, bool), jnp.asarray(0.0))
    assert float(beliefs.noise[0]) == 0.0 < float(beliefs.noise[1])
    np.testing.assert_allclose(beliefs.mean[0], alone.mean, atol=1e-3)
    assert np.isfinite(beliefs.mean).all()


def draw_scaled(seed, spread):
    """Slots of a survey, all around one place (`spread` domain units), and a query of the same shape everywhere."""
    _, x, y, mask, new_x, _ = draw(seed)
    return 0.5 + spread * (x - 0.5), y, mask, 0.5 + spread * (new_x - 0.5)


def chain(x, y, mask, new_x, scale, noise):
    """Means and variances of a belief conditioned, extended and asked elsewhere, and its nugget.

    The values are times `scale`, the variances times its square; so is what comes back.
    """
    real = jnp.float32
    x, y, new_x, query = (jnp.asarray(a, real) for a in (x, y, new_x, QUERY))
    scale = jnp.asarray(scale, real)
    kernel = Matern32(jnp.asarray(LENGTH_SCALE, real), scale**2)
    belief = condition_(kernel, x, scale * y, jnp.asarray(mask), query, scale**2 * jnp.asarray(noise, real))
    seen = extend_(belief, new_x, jnp.ones(NEW, bool), virtual_value="zero")
    moments = [(b.mean, b.variance) for b in (belief, seen, on_(seen, new_x))]
    means, variances = (np.concatenate(rows) for rows in zip(*moments, strict=True))
    return means, variances, float(belief.noise)


@given(SEEDS, st.floats(-4, 4), st.sampled_from([1e-4, 1e-2]))
def test_values_times_c_and_variances_times_c_squared_are_the_same_belief(seed, power, noise):
    """Noise well above float32's rounding, so that no nugget is needed and what differs is rounding alone."""
    drawn, c = draw_scaled(seed, 1.0), 10.0**power
    (mean, variance, nugget), (mean_c, variance_c, nugget_c) = chain(*drawn, 1.0, noise), chain(*drawn, c, noise)
    np.testing.assert_allclose(mean_c / c, mean, rtol=1e-3, atol=5e-3)
    np.testing.assert_allclose(variance_c / c**2, variance, rtol=1e-3, atol=2e-4)
    assert nugget_c / c**2 == pytest.approx(nugget, rel=1e-5) == pytest.approx(noise, rel=1e-5)


@given(SEEDS, st.integers(-13, 13), st.sampled_from([0.0, 1e-10, 1e-6, 1e-4]), st.sampled_from([0.0, 1e-6, 1e-3, 1.0]))
def test_a_scale_that_does_not_round_gives_the_same_nugget_bit_for_bit(seed, exponent, noise, spread):
    """A power of two only moves exponents, so duplicates need the same nugget relative to the signal variance."""
    drawn, c = draw_scaled(seed, spread), 2.0**exponent
    (mean, variance, nugget), (mean_c, variance_c, nugget_c) = chain(*drawn, 1.0, noise), chain(*drawn, c, noise)
    np.testing.assert_array_equal(mean_c / c, mean)
    np.testing.assert_array_equal(variance_c / c**2, variance)
    assert nugget_c / c**2 == nugget
    assert np.isfinite(mean).all() and np.isfinite(variance).all()


@pytest.mark.parametrize("variance", [1e-8, 1.0, 1e8])
def test_near_duplicates_are_factored_at_any_signal_variance(variance):
    """45 measurements within 1e-4 of one place: a nugget of 0.1 is nothing to a signal variance of 1e8."""
    rng, scale = np.random.default_rng(0), variance**0.5
    x = jnp.asarray(0.5 + 1e-4 * rng.normal(size=(45, 2)), jnp.float32)
    kernel, every = Matern32(LENGTH_SCALE, jnp.float32(variance)), jnp.ones(45, bool)
    belief = condition_(kernel, x, jnp.full(45, 0.8 * scale), every, jnp.asarray(QUERY, jnp.float32), 1e-10 * variance)
    assert np.isfinite(belief.mean).all() and np.isfinite(belief.variance).all()
    assert float(belief.noise) <= 0.1 * variance
    assert float(on_(belief, x).mean[0]) == pytest.approx(0.8 * scale, rel=0.02)
    assert (np.asarray(belief.variance) <= variance).all()


@pytest.mark.parametrize("broken", ["place", "noise"])
def test_a_belief_that_cannot_be_factored_is_nan_everywhere(broken):
    _, x, y, mask, new_x, _ = draw(1)
    mask = mask | (np.arange(SLOTS) == 0)
    extra = np.zeros(SLOTS)
    (x if broken == "place" else extra)[0] = np.nan
    places, values, query, extra = (jnp.asarray(a, jnp.float32) for a in (x, y, QUERY, extra))
    belief = condition(KERNEL, places, values, jnp.asarray(mask), query, 1e-6, extra)
    more = extend_(belief, jnp.asarray(new_x, jnp.float32), jnp.ones(NEW, bool))
    for told in (belief, more, on_(belief, jnp.asarray(new_x, jnp.float32))):
        assert np.isnan(told.mean).all() and np.isnan(told.variance).all()
