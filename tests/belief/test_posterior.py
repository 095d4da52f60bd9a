"""The posterior: reference vectors, scikit-learn, and the identities that conditioning must keep."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from maipp.belief import (
    Interest,
    Matern32,
    condition,
    mutual_information,
    rmse,
    trace,
)
from tests.belief.slots import (
    KERNEL,
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


@pytest.fixture(scope="module")
def vectors():
    with np.load(Path(__file__).parents[1] / "data" / "gp_vectors.npz") as file:
        return dict(file)


def reference(vectors, f):
    """Grid, measurements and the reference posterior, flattened."""
    keys = (f"meas{f}_x", f"meas{f}_y", f"post{f}_mean", f"post{f}_std", f"post{f}_mask", f"field{f}_grid")
    x, y, *grids = (vectors[key] for key in keys)
    return x, y, *(array.reshape(-1) for array in grids)


@pytest.mark.parametrize("f", [0, 1, 2])
def test_float64_matches_the_reference_vectors(vectors, f):
    x, y, mean, std, mask, truth = reference(vectors, f)
    with jax.enable_x64(True):
        grid = jnp.asarray(vectors["grid"])
        belief = condition_(KERNEL, jnp.asarray(x), jnp.asarray(y), jnp.ones(len(x), bool), grid, 1e-10)
        assert belief.mean.dtype == jnp.float64
        area = Interest().area(belief.mean, belief.variance, jnp.asarray(True))
        np.testing.assert_allclose(belief.mean, mean, rtol=0, atol=1e-8)
        np.testing.assert_allclose(belief.variance, std**2, rtol=0, atol=1e-8)
        # At a measured point the standard deviation is the root of a difference that cancels, so it gets less.
        np.testing.assert_allclose(belief.std, std, rtol=0, atol=1e-7)
        np.testing.assert_array_equal(area, mask)
        inside = jnp.ones(len(grid), bool)
        found = {
            "trace_high": trace(belief.variance, area),
            "trace_all": trace(belief.variance, inside),
            "rmse": rmse(belief.mean, jnp.asarray(truth), inside),
            "mi_high": mutual_information(belief, area),
        }
        for name, value in found.items():
            assert float(value) == pytest.approx(float(vectors[f"post{f}_{name}"]), abs=1e-8), name


@pytest.mark.parametrize("f", [0, 1, 2])
def test_float32_with_the_default_nugget_gives_the_reference_trace(vectors, f):
    x, y, mean, std, mask, _ = reference(vectors, f)
    grid = jnp.asarray(vectors["grid"], jnp.float32)
    belief = condition_(KERNEL, jnp.asarray(x), jnp.asarray(y), jnp.ones(len(x), bool), grid)
    assert belief.mean.dtype == jnp.float32
    area = Interest().area(belief.mean, belief.variance, jnp.asarray(True))
    assert float(trace(belief.variance, area)) == pytest.approx(float(vectors[f"post{f}_trace_high"]), rel=1e-3)
    np.testing.assert_allclose(belief.mean, mean, atol=1e-3)
    np.testing.assert_allclose(belief.variance, std**2, atol=1e-3)
    # Only points whose bound is within rounding of the threshold may change sides.
    assert (np.abs(mean + std - 0.4)[np.asarray(area) != mask] < 1e-3).all()


@settings(max_examples=15)
@given(SEEDS, st.floats(0.1, 2.0), st.floats(0.2, 5.0), st.floats(1e-6, 1e-1))
def test_scikit_learn_agrees(seed, length_scale, variance, noise):
    rng = np.random.default_rng(seed)
    x, y = rng.random((SLOTS, 2)), rng.normal(size=SLOTS)
    prior = ConstantKernel(variance) * Matern(length_scale, nu=1.5)
    model = GaussianProcessRegressor(prior, alpha=noise, optimizer=None)  # pyright: ignore[reportArgumentType]
    mean, std = map(np.asarray, model.fit(x, y).predict(QUERY, return_std=True))
    with jax.enable_x64(True):
        kernel = Matern32(jnp.asarray(length_scale), jnp.asarray(variance))
        belief = condition_(kernel, *map(jnp.asarray, (x, y, np.ones(SLOTS, bool), QUERY)), noise=jnp.asarray(noise))
        scale = 1e-8 * max(1.0, np.abs(mean).max())
        np.testing.assert_allclose(belief.mean, mean, rtol=0, atol=scale)
        np.testing.assert_allclose(belief.variance, std**2, rtol=0, atol=1e-8)


@pytest.mark.parametrize("variance", [1.0, 2.5])
def test_zero_measurements_give_the_prior(variance):
    kernel = Matern32(0.3, variance)
    empty = condition(kernel, jnp.zeros((0, 2)), jnp.zeros(0), jnp.zeros(0, bool), jnp.asarray(QUERY))
    np.testing.assert_array_equal(empty.mean, 0.0)
    np.testing.assert_array_equal(empty.variance, variance)
    masked = condition(kernel, jnp.ones((3, 2)), jnp.ones(3), jnp.zeros(3, bool), jnp.asarray(QUERY))
    np.testing.assert_array_equal(masked.mean, 0.0)
    np.testing.assert_array_equal(masked.variance, variance)


def same(belief, other, atol=1e-8):
    np.testing.assert_allclose(belief.mean, other.mean, rtol=0, atol=atol)
    np.testing.assert_allclose(belief.variance, other.variance, rtol=0, atol=atol)


@pytest.mark.parametrize(("x64", "slack"), [(True, 1e-12), (False, 1e-5)])
@given(seed=SEEDS)
def test_variance_never_rises_with_data(seed, x64, slack):
    _, x, y, mask, _, _ = draw(seed)
    with jax.enable_x64(x64):
        before = np.ones(len(QUERY))
        for count in range(1, SLOTS + 1):
            after = np.asarray(belief_of(x, y, mask & (np.arange(SLOTS) < count)).variance)
            assert (after <= before + slack).all()
            assert (after >= 0).all()
            before = after


@given(SEEDS)
def test_order_of_measurements_is_irrelevant(seed):
    rng, x, y, mask, _, _ = draw(seed)
    order = rng.permutation(SLOTS)
    with jax.enable_x64(True):
        same(belief_of(x, y, mask), belief_of(x[order], y[order], mask[order]))


@given(SEEDS)
def test_masked_slots_have_no_influence(seed):
    rng, x, y, mask, _, _ = draw(seed)
    junk_x = np.where(mask[:, None], x, rng.normal(size=(SLOTS, 2)) * 100)
    junk_y = np.where(mask, y, np.nan)
    with jax.enable_x64(True):
        belief, junk = belief_of(x, y, mask), belief_of(junk_x, junk_y, mask)
        same(belief, junk, atol=0)
        mean, variance = exact(x[mask], y[mask], QUERY, 1e-6)
        np.testing.assert_allclose(belief.mean, mean, rtol=0, atol=1e-8)
        np.testing.assert_allclose(belief.variance, variance, rtol=0, atol=1e-8)


@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
@given(seed=SEEDS)
def test_extend_is_recondition_on_virtual_values(seed, virtual_value):
    rng, x, y, mask, new_x, _ = draw(seed)
    new_mask = rng.random(NEW) < 0.7
    with jax.enable_x64(True):
        belief = belief_of(x, y, mask)
        more = extend_(belief, jnp.asarray(new_x), jnp.asarray(new_mask), virtual_value=virtual_value)
        expected = np.asarray(on_(belief, jnp.asarray(new_x)).mean) if virtual_value == "mean" else np.zeros(NEW)
        again = belief_of(np.concatenate([x, new_x]), np.concatenate([y, expected]), np.concatenate([mask, new_mask]))
        same(more, again)
        if virtual_value == "mean":
            np.testing.assert_array_equal(more.mean, belief.mean)
        # The extended belief is a belief like any other: it predicts elsewhere and extends further.
        elsewhere = jnp.asarray(rng.random((NEW, 2)))
        same(on_(more, elsewhere), on_(again, elsewhere))


@given(SEEDS)
def test_a_belief_on_other_points_is_what_the_measurements_say_there(seed):
    rng, x, y, mask, new_x, _ = draw(seed)
    with jax.enable_x64(True):
        belief, points = belief_of(x, y, mask), rng.random((NEW, 2))
        same(on_(belief, belief.query), belief, atol=1e-10)
        moved = on_(belief, jnp.asarray(points))
        mean, variance = exact(x[mask], y[mask], points, 1e-6)
        np.testing.assert_allclose(moved.mean, mean, rtol=0, atol=1e-8)
        np.testing.assert_allclose(moved.variance, variance, rtol=0, atol=1e-8)
        np.testing.assert_array_equal(moved.query, points)
        # It goes on like any other.
        more = (jnp.asarray(new_x), jnp.ones(NEW, bool))
        same(extend_(moved, *more), on_(extend_(belief, *more), jnp.asarray(points)))


def test_a_coarser_belief_is_the_belief_at_fewer_points():
    _, x, y, mask, new_x, _ = draw(2)
    belief = belief_of(x, y, mask)
    index = np.arange(3, 36, 7)
    coarse = belief.at(jnp.asarray(index))
    for name in ("query", "mean", "variance", "std"):
        np.testing.assert_array_equal(getattr(coarse, name), getattr(belief, name)[index])
    more = (jnp.asarray(new_x, jnp.float32), jnp.ones(NEW, bool))
    np.testing.assert_allclose(extend_(coarse, *more).variance, extend_(belief, *more).variance[index], atol=1e-5)


def test_gradients_in_the_measurements_are_those_of_finite_differences():
    _, x, y, mask, _, _ = draw(4)

    @jax.jit
    def total(x, y):
        belief = condition(KERNEL, x, y, jnp.asarray(mask), jnp.asarray(QUERY), 1e-4)
        return jnp.sum(belief.mean**2) + jnp.sum(belief.variance)

    with jax.enable_x64(True):
        slopes = jax.jit(jax.grad(total, argnums=(0, 1)))(jnp.asarray(x), jnp.asarray(y))
        np.testing.assert_array_equal(slopes[0][~mask], 0.0)
        rng, step = np.random.default_rng(0), 1e-6
        dx, dy = rng.normal(size=x.shape), rng.normal(size=y.shape)
        ends = [float(total(jnp.asarray(x + s * dx), jnp.asarray(y + s * dy))) for s in (step, -step)]
        along = float(jnp.sum(slopes[0] * dx) + jnp.sum(slopes[1] * dy))
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(along, rel=1e-4)
