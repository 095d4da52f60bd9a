"""Intents as measurements to be expected: the points have the intent's moments, and nobody's change nothing."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.belief import Matern32, condition
from maipp.planners.announced.intents import intent_points, with_intents
from maipp.team import Intent

AGENTS, MEASURED = 3, 4
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)

points_ = eqx.filter_jit(intent_points)
with_ = eqx.filter_jit(with_intents)
condition_ = eqx.filter_jit(condition)


def draw(seed):
    """A belief, what was measured for it, and an intent of every agent."""
    rng = np.random.default_rng(seed)
    x, y = rng.random((MEASURED, 2)).astype(np.float32), rng.random(MEASURED).astype(np.float32)
    root = 0.2 * rng.normal(size=(AGENTS, 2, 2)) + 0.05 * np.eye(2)
    covariance = root @ np.swapaxes(root, 1, 2)
    mean = rng.random((AGENTS, 2))
    upper = np.stack([covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]], axis=-1)
    intents = Intent(jnp.asarray(mean, jnp.float32), jnp.asarray(upper, jnp.float32))
    belief = condition_(
        Matern32(0.45), jnp.asarray(x), jnp.asarray(y), jnp.ones(MEASURED, bool), jnp.asarray(QUERY), 1e-4
    )
    return belief, x, y, intents, covariance


@given(st.integers(0, 2**32 - 1))
def test_points_have_the_mean_and_the_variance_along_the_longer_axis(seed):
    *_, intents, covariance = draw(seed)
    points = np.asarray(points_(intents), np.float64)
    assert points.shape == (AGENTS, 3, 2)
    np.testing.assert_allclose(points.mean(axis=1), intents.mean, atol=1e-6)
    for spread, expected in zip(points - points.mean(axis=1, keepdims=True), covariance, strict=True):
        found = np.linalg.eigvalsh(spread.T @ spread / 3)
        largest = np.linalg.eigvalsh(expected)[1]
        np.testing.assert_allclose(found, [0, largest], atol=1e-4 * largest + 1e-7)
        axis = spread[2] / np.linalg.norm(spread[2])
        assert axis @ expected @ axis == pytest.approx(largest, rel=1e-3)


def test_points_of_a_round_intent_lie_at_its_deviation():
    spread = points_(Intent(jnp.zeros(2), jnp.array([0.04, 0.0, 0.04])))
    np.testing.assert_allclose(np.linalg.norm(spread, axis=1), [0.2 * 1.5**0.5, 0, 0.2 * 1.5**0.5], rtol=1e-6)


@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
def test_nobody_s_intents_change_nothing(virtual_value):
    belief, *_, intents, _ = draw(1)
    untold = Intent(jnp.full((AGENTS, 2), jnp.nan), intents.covariance)
    for told, heard in ((intents, jnp.zeros(AGENTS, bool)), (untold, jnp.ones(AGENTS, bool))):
        after = with_(belief, told, heard, virtual_value)
        np.testing.assert_array_equal(after.mean, belief.mean)
        np.testing.assert_array_equal(after.variance, belief.variance)


@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
@given(seed=st.integers(0, 2**32 - 1))
def test_each_intent_that_is_heard_counts_as_three_measurements(seed, virtual_value):
    belief, x, y, intents, _ = draw(seed)
    heard = jnp.array([True, False, True])
    after = with_(belief, intents, heard, virtual_value)
    spots = np.asarray(points_(intents))[np.asarray(heard)].reshape(-1, 2)
    where, values = jnp.asarray(np.concatenate([x, spots])), jnp.asarray(np.concatenate([y, np.zeros(6, np.float32)]))
    anew = condition_(Matern32(0.45), where, values, jnp.ones(MEASURED + 6, bool), jnp.asarray(QUERY), 1e-4)
    np.testing.assert_allclose(after.variance, anew.variance, atol=3e-3)
    np.testing.assert_allclose(after.mean, belief.mean if virtual_value == "mean" else anew.mean, atol=1e-2)
    assert (np.asarray(after.variance) <= np.asarray(belief.variance)).all()
