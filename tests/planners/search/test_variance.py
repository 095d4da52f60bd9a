"""The written-out slope of the variance that plans leave is that of automatic differentiation."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.belief import Matern12, Matern32, Matern52, SquaredExponential, condition, condition_near, extend
from maipp.planners.lookahead import predicted_variance
from maipp.planners.search.variance import variance_left

QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 6)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
SLOTS, PLANS, LEGS = 8, 3, 4
# Determinant 1: (0.8 * 1.8 - 0.44) = 1.
WARP = jnp.asarray([[0.8, 0.44**0.5], [0.44**0.5, 1.8]])
KERNELS = {"isotropic": Matern32(0.45, 1.5), "anisotropic": Matern32(0.45, 0.8, WARP)}
KERNELS |= {kind.__name__: kind(0.45, 0.8, WARP) for kind in (Matern12, Matern52, SquaredExponential)}


@eqx.filter_jit
def both(belief, points, taken, weight):
    """Value and slope of the weighted variances, by automatic differentiation and as written out."""

    def weighted(left):
        return lambda points: jnp.sum(weight * left(belief, points, taken))

    return [jax.value_and_grad(weighted(left))(points) for left in (predicted_variance, variance_left)]


def draw(seed):
    """Measurements in some slots, plans some of whose measurements are taken, and a weight for every variance."""
    rng = np.random.default_rng(seed)
    measured = jnp.asarray(rng.random((SLOTS, 2))), jnp.asarray(rng.normal(size=SLOTS)), rng.random(SLOTS) < 0.7
    points, taken = jnp.asarray(rng.random((PLANS, LEGS, 2))), jnp.asarray(rng.random((PLANS, LEGS)) < 0.7)
    return measured, points, taken, jnp.asarray(rng.normal(size=(PLANS, len(QUERY))))


@pytest.mark.parametrize("kernel", KERNELS)
@given(st.integers(0, 2**32 - 1))
def test_slope(kernel, seed):
    with jax.enable_x64(True):
        (x, y, mask), points, taken, weight = draw(seed)
        prior = jax.tree.map(jnp.asarray, KERNELS[kernel])
        belief = eqx.filter_jit(condition)(prior, x, y, jnp.asarray(mask), jnp.asarray(QUERY), 1e-3)
        (value, wanted), (same, slope) = both(belief, points, taken, weight)
        # The same sum, compiled twice: some rounding apart.
        assert float(value) == pytest.approx(float(same), rel=1e-12)
        np.testing.assert_allclose(slope, wanted, rtol=1e-8, atol=1e-9)
        assert (np.asarray(slope)[~np.asarray(taken)] == 0).all()


def test_slope_with_announced_measurements_and_a_limited_belief():
    with jax.enable_x64(True):
        (x, y, _), points, taken, weight = draw(5)
        belief = condition_near(
            Matern32(0.45), x, y, jnp.ones(SLOTS, bool), jnp.asarray(QUERY), 1e-3, near=x[0], reach=0.1, capacity=5
        )
        assert belief.shrink is not None
        belief = extend(belief, jnp.asarray([[0.9, 0.2], [0.1, 0.8]]), jnp.asarray([True, False]))
        (_, wanted), (_, slope) = both(belief, points, taken, weight)
        np.testing.assert_allclose(slope, wanted, rtol=1e-8, atol=1e-9)


def test_a_measurement_on_top_of_another_has_a_finite_slope():
    (x, y, mask), points, taken, weight = draw(6)
    belief = condition(Matern32(0.45), x, y, jnp.asarray(mask), jnp.asarray(QUERY, x.dtype), 0.0)
    points, taken = points.at[0].set(x[0]), jnp.ones_like(taken)
    _, (_, slope) = both(dataclasses.replace(belief, noise=jnp.zeros(())), points, taken, weight)
    assert jnp.isfinite(slope).all()
