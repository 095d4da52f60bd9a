"""The posterior: reference vectors, scikit-learn, and the identities that conditioning must keep."""

from functools import partial
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from maipp.belief import (
    Matern32,
    append,
    condition,
    extend,
    high_interest_area,
    mutual_information,
    posterior,
    predict,
    rmse,
    trace,
)

SEEDS = st.integers(0, 2**32 - 1)
LENGTH_SCALE = 0.45
KERNEL = Matern32(LENGTH_SCALE)
SLOTS, NEW = 10, 4
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 6)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)

# One shape for the whole module, so that each of these compiles once per precision.
condition_ = eqx.filter_jit(condition)
append_ = eqx.filter_jit(append)
extend_ = eqx.filter_jit(extend)
predict_ = eqx.filter_jit(predict)
on_ = eqx.filter_jit(lambda belief, points: belief.on(points))


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
        area = high_interest_area(belief.mean, belief.variance)
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
    area = high_interest_area(belief.mean, belief.variance)
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


def test_posterior_of_plain_arrays():
    x, y = np.array([[0.2, 0.3], [0.8, 0.1]]), np.array([0.5, -0.5])
    mean, variance = posterior(KERNEL, jnp.asarray(x), jnp.asarray(y), jnp.asarray(QUERY))
    again = posterior(KERNEL, x, y, QUERY)
    np.testing.assert_array_equal(again[0], mean)
    np.testing.assert_array_equal(again[1], variance)
    at = posterior(KERNEL, x, y, x)
    np.testing.assert_allclose(at[0], y, atol=1e-5)
    np.testing.assert_allclose(at[1], 0.0, atol=1e-5)


@pytest.mark.parametrize("variance", [1.0, 2.5])
def test_zero_measurements_give_the_prior(variance):
    kernel = Matern32(0.3, variance)
    mean, spread = posterior(kernel, jnp.zeros((0, 2)), jnp.zeros(0), jnp.asarray(QUERY))
    np.testing.assert_array_equal(mean, 0.0)
    np.testing.assert_array_equal(spread, variance)
    masked = condition(kernel, jnp.ones((3, 2)), jnp.ones(3), jnp.zeros(3, bool), jnp.asarray(QUERY))
    np.testing.assert_array_equal(masked.mean, 0.0)
    np.testing.assert_array_equal(masked.variance, variance)


def exact(x, y, query, noise):
    """The posterior in NumPy, by solving the normal equations: no Cholesky factor, no masks."""
    matern = Matern(LENGTH_SCALE, nu=1.5)
    cross = matern(x, query)
    weights = np.linalg.solve(matern(x, x) + noise * np.eye(len(x)), cross)
    return y @ weights, 1.0 - np.sum(cross * weights, axis=0)


def draw(seed):
    """Random slots: positions, values, mask, more positions and values."""
    rng = np.random.default_rng(seed)
    x, y, mask = rng.random((SLOTS, 2)), rng.normal(size=SLOTS), rng.random(SLOTS) < 0.6
    return rng, x, y, mask, rng.random((NEW, 2)), rng.normal(size=NEW)


def belief_of(x, y, mask, noise: float | jax.Array = 1e-6):
    """The belief at the precision JAX is in."""
    real = jnp.result_type(float)
    x, y, query = (jnp.asarray(a, real) for a in (x, y, QUERY))
    return condition_(KERNEL, x, y, jnp.asarray(mask), query, noise)


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


@given(SEEDS, st.integers(1, NEW))
def test_append_is_recondition_in_any_slot(seed, count):
    """Free slots lie anywhere between measured ones; several appends fill them in order."""
    _, x, y, mask, new_x, new_y = draw(seed)
    with jax.enable_x64(True):
        belief = belief_of(x, y, mask)
        for i in range(count):
            free = np.flatnonzero(~mask)
            belief = append_(belief, jnp.asarray(new_x[i]), jnp.asarray(new_y[i]))
            if len(free):
                x[free[0]], y[free[0]], mask[free[0]] = new_x[i], new_y[i], True
            np.testing.assert_array_equal(belief.mask, mask)
        same(belief, belief_of(x, y, mask))
        # What later look-aheads read must be right too, not only the prediction at the query points.
        more = (jnp.asarray(new_x[0]), jnp.asarray(0.3))
        same(append_(belief, *more), append_(belief_of(x, y, mask), *more))


def test_append_to_a_full_belief_changes_nothing():
    _, x, y, _, new_x, _ = draw(0)
    belief = belief_of(x, y, np.ones(SLOTS, bool))
    after = append_(belief, jnp.asarray(new_x[0], jnp.float32), jnp.asarray(3.0))
    for old, new in zip(jax.tree.leaves(belief), jax.tree.leaves(after), strict=True):
        np.testing.assert_array_equal(old, new)


@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
@given(seed=SEEDS)
def test_extend_is_recondition_on_virtual_values(seed, virtual_value):
    rng, x, y, mask, new_x, _ = draw(seed)
    new_mask = rng.random(NEW) < 0.7
    with jax.enable_x64(True):
        belief = belief_of(x, y, mask)
        more = extend_(belief, jnp.asarray(new_x), jnp.asarray(new_mask), virtual_value=virtual_value)
        expected = np.asarray(predict_(belief, jnp.asarray(new_x))[0]) if virtual_value == "mean" else np.zeros(NEW)
        again = belief_of(np.concatenate([x, new_x]), np.concatenate([y, expected]), np.concatenate([mask, new_mask]))
        same(more, again)
        if virtual_value == "mean":
            np.testing.assert_array_equal(more.mean, belief.mean)
        # The extended belief is a belief like any other: it predicts elsewhere and extends further.
        elsewhere = jnp.asarray(rng.random((NEW, 2)))
        for found, wanted in zip(predict_(more, elsewhere), predict_(again, elsewhere), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8)


@given(SEEDS)
def test_predict_agrees_with_the_query_predictions(seed):
    _, x, y, mask, _, _ = draw(seed)
    with jax.enable_x64(True):
        belief = belief_of(x, y, mask)
        mean, variance = predict_(belief, belief.query)
        np.testing.assert_allclose(mean, belief.mean, rtol=0, atol=1e-10)
        np.testing.assert_allclose(variance, belief.variance, rtol=0, atol=1e-10)


@given(SEEDS)
def test_a_belief_on_other_points_is_what_it_predicts_there(seed):
    _, x, y, mask, new_x, new_y = draw(seed)
    with jax.enable_x64(True):
        belief, points = belief_of(x, y, mask), jnp.asarray(np.random.default_rng(seed).random((NEW, 2)))
        moved = on_(belief, points)
        for found, wanted in zip((moved.mean, moved.variance), predict_(belief, points), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10)
        np.testing.assert_array_equal(moved.query, points)
        # It goes on like any other.
        spot, value = jnp.asarray(new_x[0]), jnp.asarray(new_y[0])
        more, wanted = append_(moved, spot, value), predict_(append_(belief, spot, value), points)
        np.testing.assert_allclose(more.mean, wanted[0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(more.variance, wanted[1], rtol=0, atol=1e-8)


def test_a_coarser_belief_is_the_belief_at_fewer_points():
    _, x, y, mask, new_x, _ = draw(2)
    belief = belief_of(x, y, mask)
    index = np.arange(3, 36, 7)
    coarse = belief.at(jnp.asarray(index))
    for name in ("query", "mean", "variance", "std"):
        np.testing.assert_array_equal(getattr(coarse, name), getattr(belief, name)[index])
    point, value = jnp.asarray(new_x[0], jnp.float32), jnp.asarray(0.3)
    np.testing.assert_allclose(append_(coarse, point, value).mean, append_(belief, point, value).mean[index], atol=1e-5)


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
def test_near_duplicates_appended_or_extended_stay_finite_in_float32(gap):
    rng = np.random.default_rng(4)
    at = np.array([0.4, 0.6])
    mask = np.arange(SLOTS) < 2
    x = np.where(mask[:, None], at, 0.0) + gap * rng.normal(size=(SLOTS, 2))
    belief = belief_of(x, np.full(SLOTS, 0.8), mask)
    # Both the belief with the point appended over and over, and a look-ahead that stands still.
    for step in range(SLOTS - 2):
        belief = append_(belief, jnp.asarray(at + gap * rng.normal(size=2), jnp.float32), jnp.asarray(0.8))
        more = extend_(
            belief, jnp.asarray(np.tile(at, (NEW, 1)), jnp.float32), jnp.ones(NEW, bool), virtual_value="mean"
        )
        for b in (belief, more):
            mean, variance = predict_(b, jnp.asarray(at, jnp.float32)[None])
            assert np.isfinite(b.mean).all() and np.isfinite(b.variance).all(), step
            assert (np.asarray(b.variance) >= 0).all() and (np.asarray(b.variance) <= 1).all()
            assert float(mean[0]) == pytest.approx(0.8, abs=0.02)
            assert 0 <= float(variance[0]) < 0.01


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
    rng, x, y, mask, new_x, new_y = draw(seed)
    return 0.5 + spread * (x - 0.5), y, mask, 0.5 + spread * (new_x - 0.5), new_y


def chain(x, y, mask, new_x, new_y, scale, noise):
    """Means and variances of a belief conditioned, appended to, extended and asked elsewhere, and its nugget.

    The values are times `scale`, the variances times its square; so is what comes back.
    """
    real = jnp.float32
    x, y, new_x, new_y, query = (jnp.asarray(a, real) for a in (x, y, new_x, new_y, QUERY))
    scale = jnp.asarray(scale, real)
    kernel = Matern32(jnp.asarray(LENGTH_SCALE, real), scale**2)
    belief = condition_(kernel, x, scale * y, jnp.asarray(mask), query, scale**2 * jnp.asarray(noise, real))
    more = append_(belief, new_x[0], scale * new_y[0])
    seen = extend_(more, new_x, jnp.ones(NEW, bool), virtual_value="zero")
    moments = [(b.mean, b.variance) for b in (belief, more, seen)] + [predict_(seen, new_x)]
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
    assert float(predict_(belief, x)[0][0]) == pytest.approx(0.8 * scale, rel=0.02)
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
    appended = append_(belief, jnp.asarray(new_x[0], jnp.float32), jnp.asarray(0.5))
    for told in (belief, more, appended, on_(belief, jnp.asarray(new_x, jnp.float32))):
        assert np.isnan(told.mean).all() and np.isnan(told.variance).all()
