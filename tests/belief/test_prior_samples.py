"""Prior samples: conditioning on them first and on measurements later is conditioning on all of them at once."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from maipp.belief import Matern32, PriorSamples, condition, condition_near

SEEDS = st.integers(0, 2**32 - 1)
KERNEL = Matern32(0.4, 0.7)
SAMPLES, SLOTS, NOISE = 9, 6, 1e-3
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)


@jax.jit
def at_once(prior, x, y, mask):
    """Mean and variance from everything in one factor."""
    x, y, mask, extra_noise = prior.after(x, y, mask, NOISE)
    belief = condition(KERNEL, x, y, mask, jnp.asarray(QUERY, x.dtype), NOISE, extra_noise)
    return belief.mean, belief.variance


@jax.jit
def one_after_the_other(prior, x, y, mask):
    return prior.process(KERNEL, x, jnp.asarray(QUERY, x.dtype), NOISE).given(y, mask, NOISE)


def draw(seed, noise=True):
    """Samples, and measurements in some slots, from one surface."""
    rng = np.random.default_rng(seed)
    x = rng.random((SAMPLES + SLOTS, 2))
    y = np.sin(5 * x[:, 0]) + x[:, 1] ** 2 + 0.1 * rng.normal(size=len(x))
    # From better than the robots' to far worse.
    own = jnp.asarray(10.0 ** rng.uniform(-5, -0.5, SAMPLES)) if noise else None
    prior = PriorSamples(jnp.asarray(x[:SAMPLES]), jnp.asarray(y[:SAMPLES]), own)
    return prior, jnp.asarray(x[SAMPLES:]), jnp.asarray(y[SAMPLES:]), jnp.asarray(rng.random(SLOTS) < 0.7)


def reference(prior, x, y, mask):
    """scikit-learn's mean and variance, with a noise variance for each measurement."""
    noise = np.full(SAMPLES, NOISE) if prior.noise is None else np.asarray(prior.noise)
    alpha = np.concatenate([noise, np.full(int(mask.sum()), NOISE)])
    kernel = ConstantKernel(KERNEL.variance) * Matern(KERNEL.length_scale, nu=1.5)
    process = GaussianProcessRegressor(kernel, alpha=alpha, optimizer=None)
    known = np.asarray(mask)
    process.fit(np.concatenate([prior.x, x[known]]), np.concatenate([prior.y, y[known]]))
    mean, std = process.predict(QUERY, return_std=True)
    return mean, std**2


@settings(max_examples=20)
@given(SEEDS, st.booleans())
def test_both_ways_agree_with_scikit_learn(seed, noise):
    with jax.enable_x64(True):
        case = draw(seed, noise)
        mean, variance = reference(*case)
        for found in (at_once(*case), one_after_the_other(*case)):
            np.testing.assert_allclose(found[0], mean, rtol=0, atol=1e-8)
            np.testing.assert_allclose(found[1], variance, rtol=0, atol=1e-8)


@settings(max_examples=20)
@given(SEEDS)
def test_their_order_does_not_matter(seed):
    with jax.enable_x64(True):
        prior, *measured = draw(seed)
        order = np.random.default_rng(seed).permutation(SAMPLES)
        other = one_after_the_other(PriorSamples(*(a[order] for a in prior)), *measured)
        for a, b in zip(one_after_the_other(prior, *measured), other, strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-10)


@settings(max_examples=20)
@given(SEEDS, st.integers(0, SAMPLES))
def test_more_samples_never_raise_the_variance(seed, count):
    with jax.enable_x64(True):
        prior, *measured = draw(seed)
        # A sample of no information is none: the same compiled function serves fewer samples.
        fewer = prior._replace(noise=jnp.where(jnp.arange(SAMPLES) < count, prior.noise, 1e12))
        more, less = one_after_the_other(prior, *measured)[1], one_after_the_other(fewer, *measured)[1]
        assert (np.asarray(more) <= np.asarray(less) + 1e-9).all()


@settings(max_examples=20)
@given(SEEDS)
def test_duplicates_break_nothing_in_float32(seed):
    prior, x, y, _ = (jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), part) for part in draw(seed, False))
    everywhere = jnp.ones(SLOTS, bool)
    # All samples in three places, and half of the measurements on top of those.
    prior = prior._replace(x=prior.x[jnp.arange(SAMPLES) % 3])
    x = x.at[::2].set(prior.x[:3])
    for mean, variance in (at_once(prior, x, y, everywhere), one_after_the_other(prior, x, y, everywhere)):
        assert np.isfinite(mean).all()
        assert (np.asarray(variance) >= 0).all() and (np.asarray(variance) <= 0.7 + 1e-6).all()
    with jax.enable_x64(True):
        exact = at_once(*jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (prior, x, y)), everywhere)
    np.testing.assert_allclose(variance, exact[1], atol=2e-3)


def test_slots_that_hold_nothing_may_hold_anything():
    prior, x, y, _ = (jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), part) for part in draw(0))
    mask = jnp.arange(SLOTS) < 4
    junk = one_after_the_other(prior, x.at[4:].set(jnp.nan), y.at[4:].set(jnp.nan), mask)
    for a, b in zip(junk, one_after_the_other(prior, x, y, mask), strict=True):
        np.testing.assert_array_equal(a, b)


@partial(jax.jit, static_argnames="capacity")
def near_(x, y, mask, extra_noise, capacity):
    query = jnp.asarray(QUERY, x.dtype)
    place = jnp.asarray([0.3, 0.6], x.dtype)
    return condition_near(KERNEL, x, y, mask, query, NOISE, extra_noise, near=place, reach=0.3, capacity=capacity)


def test_a_window_knows_each_measurement_s_noise():
    """Its tiles hold all of so small a survey, so mean and variance are exact; without the noise they are not."""
    with jax.enable_x64(True):
        case = draw(3)
        x, y, mask, extra_noise = case[0].after(*case[1:], NOISE)
        mean, variance = reference(*case)
        for capacity in (7, SAMPLES + SLOTS):
            belief = near_(x, y, mask, extra_noise, capacity)
            assert belief.x.shape == (capacity, 2)
            np.testing.assert_allclose(belief.mean, mean, rtol=0, atol=1e-8)
            np.testing.assert_allclose(belief.variance, variance, rtol=0, atol=1e-8)
            deaf = near_(x, y, mask, None, capacity)
            assert np.abs(deaf.mean - mean).max() > 1e-3
