"""The look-ahead: equal to conditioning anew on every candidate's measurements, and differentiable."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString

from maipp.belief import Interest, Matern32, condition
from maipp.engine.polyline import along_paths
from maipp.planners.lookahead import (
    measurement_offsets,
    predicted_trace,
    predicted_variance,
    virtual_measurements,
)

SEEDS = st.integers(0, 2**32 - 1)
SLOTS, CANDIDATES, HORIZON, WAYPOINTS = 6, 3, 4, 5
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 6)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
KERNEL = Matern32(0.45, 1.5)
NOISE = 1e-4
INTEREST = Interest()

condition_ = eqx.filter_jit(condition)
on_ = eqx.filter_jit(lambda belief, points: belief.on(points))
variance_ = eqx.filter_jit(predicted_variance)
trace_ = eqx.filter_jit(predicted_trace)
rows_ = eqx.filter_jit(virtual_measurements)
along_ = jax.jit(along_paths)


def draw(seed):
    """A belief of random measurements in random slots, its parts, and random candidates."""
    rng = np.random.default_rng(seed)
    x, y, mask = rng.random((SLOTS, 2)), rng.normal(size=SLOTS) * 0.5, rng.random(SLOTS) < 0.7
    points, taken = rng.random((CANDIDATES, HORIZON, 2)), rng.random((CANDIDATES, HORIZON)) < 0.7
    return x, y, mask, points, taken


def belief_of(x, y, mask):
    real = jnp.result_type(float)
    x, y, query = (jnp.asarray(a, real) for a in (x, y, QUERY))
    return condition_(KERNEL, x, y, jnp.asarray(mask), query, NOISE)


@given(SEEDS)
def test_predicted_variance_is_that_of_conditioning_anew(seed):
    x, y, mask, points, taken = draw(seed)
    with jax.enable_x64(True):
        found = np.asarray(variance_(belief_of(x, y, mask), jnp.asarray(points), jnp.asarray(taken)))
        for c in range(CANDIDATES):
            joint = np.concatenate([x, points[c]]), np.concatenate([y, np.zeros(HORIZON)])
            anew = belief_of(*joint, np.concatenate([mask, taken[c]]))
            np.testing.assert_allclose(found[c], anew.variance, rtol=0, atol=1e-9)


@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
@given(seed=SEEDS)
def test_predicted_trace_is_that_of_conditioning_anew(seed, virtual_value):
    x, y, mask, points, taken = draw(seed)
    inside = np.random.default_rng(seed).random(len(QUERY)) < 0.9
    with jax.enable_x64(True):
        belief = belief_of(x, y, mask)
        candidates = jnp.asarray(points), jnp.asarray(taken)
        found = trace_(belief, INTEREST, jnp.asarray(inside), *candidates, virtual_value=virtual_value)
        for c in range(CANDIDATES):
            values = np.asarray(on_(belief, jnp.asarray(points[c])).mean) if virtual_value == "mean" else np.zeros(4)
            joint = np.concatenate([x, points[c]]), np.concatenate([y, values])
            anew = belief_of(*joint, np.concatenate([mask, taken[c]]))
            mean, variance = np.asarray(anew.mean), np.asarray(anew.variance)
            bound = mean + np.sqrt(variance)
            if (np.abs(bound - INTEREST.threshold) > 1e-7).all():  # else rounding decides
                assert float(found[c]) == pytest.approx(
                    variance[(bound >= INTEREST.threshold) & inside].sum(), abs=1e-8
                )


@given(SEEDS)
def test_float32_is_close_to_float64(seed):
    x, y, mask, points, taken = draw(seed)
    narrow = variance_(belief_of(x, y, mask), jnp.asarray(points, jnp.float32), jnp.asarray(taken))
    with jax.enable_x64(True):
        wide = variance_(belief_of(x, y, mask), jnp.asarray(points), jnp.asarray(taken))
    np.testing.assert_allclose(narrow, wide, atol=2e-3)


def test_measurements_that_are_not_taken_add_nothing():
    x, y, mask, points, _ = draw(0)
    belief = belief_of(x, y, mask)
    nowhere = jnp.zeros((CANDIDATES, HORIZON), bool)
    points = jnp.asarray(points, jnp.float32)
    np.testing.assert_array_equal(rows_(belief, points, nowhere).rows, 0.0)
    np.testing.assert_array_equal(variance_(belief, points, nowhere), np.tile(belief.variance, (CANDIDATES, 1)))
    for virtual_value in ("mean", "zero"):
        trace = trace_(belief, INTEREST, jnp.ones(36, bool), points, nowhere, virtual_value=virtual_value)
        expected = INTEREST.trace(belief.mean, belief.variance, jnp.ones(36, bool))
        np.testing.assert_allclose(trace, np.full(CANDIDATES, expected), rtol=1e-6)


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-4])
def test_standing_still_stays_finite_in_float32(gap):
    """Four measurements at one spot, on top of a real one: worth no more than the first, and never NaN."""
    rng = np.random.default_rng(1)
    x, y, mask, _, _ = draw(3)
    x[0], mask[0] = (0.5, 0.5), True
    belief = belief_of(x, y, mask)
    for centre in ([0.5, 0.5], [0.83, 0.21]):
        spots = np.array(centre) + gap * rng.normal(size=(CANDIDATES, HORIZON, 2))
        spots = jnp.asarray(spots, jnp.float32)
        first = jnp.zeros((CANDIDATES, HORIZON), bool).at[:, 0].set(True)
        once, often = variance_(belief, spots, first), variance_(belief, spots, jnp.ones_like(first))
        assert np.isfinite(often).all() and (np.asarray(often) >= 0).all()
        assert (np.asarray(often) <= np.asarray(once) + 1e-6).all()
        np.testing.assert_allclose(often, once, atol=0.01)
        for virtual_value in ("mean", "zero"):
            trace = trace_(
                belief, INTEREST, jnp.ones(36, bool), spots, jnp.ones_like(first), virtual_value=virtual_value
            )
            assert np.isfinite(trace).all()


@eqx.filter_jit
def total(belief, points, taken, virtual_value):
    """Sum of the predicted traces over everything: where only the area matters it would move in steps."""
    everything = Interest(threshold=-100.0)
    inside = jnp.ones(len(QUERY), bool)
    return predicted_trace(belief, everything, inside, points, taken, virtual_value=virtual_value).sum()


slope_ = eqx.filter_jit(jax.grad(total, argnums=1))


@settings(max_examples=30)
@given(SEEDS, st.sampled_from(["mean", "zero"]))
def test_gradient_in_the_points_is_that_of_finite_differences(seed, virtual_value):
    x, y, mask, points, taken = draw(seed)
    with jax.enable_x64(True):
        belief, chosen = belief_of(x, y, mask), jnp.asarray(taken)
        slope = np.asarray(slope_(belief, jnp.asarray(points), chosen, virtual_value))
        assert np.isfinite(slope).all()
        np.testing.assert_array_equal(slope[~taken], 0.0)
        direction, step = np.random.default_rng(seed).normal(size=points.shape), 1e-6
        ahead, back = (total(belief, jnp.asarray(points + s * direction), chosen, virtual_value) for s in (step, -step))
        along = float((slope * direction).sum())
        assert float(ahead - back) / (2 * step) == pytest.approx(along, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
def test_gradients_are_finite_where_points_coincide(virtual_value):
    """On a query point, on a real measurement, on each other."""
    x, y, mask, _, _ = draw(3)
    x[0], mask[0] = (0.5, 0.5), True
    belief = belief_of(x, y, mask)
    points = np.full((CANDIDATES, HORIZON, 2), 0.5)
    points[1], points[2] = QUERY[8], (0.33, 0.71)
    points, taken = jnp.asarray(points, jnp.float32), jnp.ones((CANDIDATES, HORIZON), bool)
    assert np.isfinite(slope_(belief, points, taken, virtual_value)).all()


def paths(seed):
    """A start, waypoints with some repeated, and distances up to beyond every end."""
    rng = np.random.default_rng(seed)
    waypoints = rng.random((CANDIDATES, WAYPOINTS, 2))
    waypoints[0, 2] = waypoints[0, 1]
    waypoints[1, 3:] = waypoints[1, 2]  # shorter than the others: the last one repeated
    start = rng.random(2)
    waypoints[2, 0] = start
    return start, waypoints, np.sort(rng.uniform(0, 3, HORIZON))


@given(SEEDS)
def test_points_along_paths_are_those_of_shapely(seed):
    start, waypoints, offsets = paths(seed)
    points, lengths = along_(*(jnp.asarray(a, jnp.float32) for a in (start, waypoints, offsets)))
    for c in range(CANDIDATES):
        line = LineString(np.concatenate([start[None], waypoints[c]]))
        assert float(lengths[c]) == pytest.approx(line.length, abs=2e-6)
        expected = [line.interpolate(min(offset, line.length)).coords[0] for offset in offsets]
        np.testing.assert_allclose(points[c], expected, atol=2e-6)


def test_points_along_paths_keep_leading_axes():
    start, waypoints, offsets = (jnp.asarray(a, jnp.float32) for a in paths(0))
    points, lengths = along_(start, jnp.stack([waypoints, waypoints]), offsets)
    assert points.shape == (2, CANDIDATES, HORIZON, 2) and lengths.shape == (2, CANDIDATES)
    single, length = along_(start, waypoints[1], offsets)
    np.testing.assert_allclose(points[0, 1], single, atol=1e-7)
    np.testing.assert_allclose(lengths[1, 1], length, atol=1e-7)


def test_gradients_along_paths_are_finite_where_waypoints_repeat():
    start, waypoints, offsets = (jnp.asarray(a, jnp.float32) for a in paths(0))

    def squares(waypoints):
        points, lengths = along_paths(start, waypoints, offsets)
        return jnp.sum(points**2) + jnp.sum(lengths)

    slope = jax.jit(jax.grad(squares))(waypoints)
    assert np.isfinite(slope).all()
    assert (np.abs(slope[2]) > 0).any()


def test_offsets_count_on_from_the_next_measurement():
    np.testing.assert_allclose(measurement_offsets(jnp.asarray(0.05), 0.2, 4), [0.05, 0.25, 0.45, 0.65], rtol=1e-6)
