"""The high-interest area and the measures over it: both rules, bad rules, bounds."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sklearn.gaussian_process.kernels import Matern

from maipp.belief import (
    Interest,
    Matern32,
    condition,
    mutual_information,
    rmse,
    to_rank,
    trace,
)

SEEDS = st.integers(0, 2**32 - 1)
QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
EVERYWHERE = jnp.asarray(True)
condition_ = eqx.filter_jit(condition)
information_ = eqx.filter_jit(mutual_information)


def test_the_two_rules_differ_where_the_deviation_exceeds_the_variance():
    mean = jnp.array([0.0, 0.0, 0.39, 0.41, -0.5, 0.25])
    variance = jnp.array([0.25, 0.16, 0.0, 0.0, 1.0, 0.09])
    #        std: 0.5   0.4   0.39   0.41   0.5    0.55
    np.testing.assert_array_equal(Interest().area(mean, variance, EVERYWHERE), [True, True, False, True, True, True])
    #   variance: 0.25  0.16  0.39   0.41   0.5    0.34
    by_variance = Interest(rule="variance").area(mean, variance, EVERYWHERE)
    np.testing.assert_array_equal(by_variance, [False, False, False, True, True, False])
    wide = Interest(1.0, 2.0).area(mean, variance, EVERYWHERE)
    np.testing.assert_array_equal(wide, [True, False, False, False, True, False])


@pytest.mark.parametrize("rule", ["Std", "", "sd"])
def test_a_bad_rule_is_refused(rule):
    with pytest.raises(ValueError, match=f"rule='{rule}'.*'std' or 'variance'"):
        Interest(rule=rule).area(jnp.zeros(3), jnp.ones(3), EVERYWHERE)
    with pytest.raises(ValueError, match="'std' or 'variance'"):
        Interest(rule=rule).trace(jnp.zeros(3), jnp.ones(3), jnp.ones(3, bool))


values = hnp.arrays(np.float32, (3, 25), elements=st.floats(-2, 2, width=32))
spreads = hnp.arrays(np.float32, (3, 25), elements=st.floats(0, 1, width=32))


@given(values, spreads, hnp.arrays(bool, 25), st.sampled_from(["std", "variance"]), st.floats(0, 3))
def test_interest_traces_its_own_area(mean, variance, inside, rule, beta):
    """Leading axes are kept, points outside the survey area never count."""
    interest = Interest(0.4, beta, rule)
    mean, variance = jnp.asarray(mean), jnp.asarray(variance)
    area = ~(np.asarray(interest.bound(mean, variance)) < 0.4) & inside
    np.testing.assert_array_equal(interest.area(mean, variance, jnp.asarray(inside)), area)
    expected = np.where(area, variance, 0.0).astype(np.float64).sum(axis=1)
    np.testing.assert_allclose(interest.trace(mean, variance, jnp.asarray(inside)), expected, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(trace(variance[0], jnp.asarray(area[0])), expected[0], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("rule", ["std", "variance"])
@pytest.mark.parametrize("broken", ["mean", "variance"])
@given(mean=values, variance=spreads, row=st.integers(0, 2), point=st.integers(0, 24))
def test_a_belief_that_is_not_a_number_has_no_trace(mean, variance, row, point, rule, broken):
    """One point of NaN inside is enough, and no other row minds; outside the survey area it does not count."""
    interest, inside = Interest(0.4, 1.0, rule), np.ones(25, bool)
    whole = interest.trace(jnp.asarray(mean), jnp.asarray(variance), jnp.asarray(inside))
    (mean if broken == "mean" else variance)[row, point] = np.nan
    mean, variance, others = jnp.asarray(mean), jnp.asarray(variance), np.arange(3) != row

    def traces(inside):
        inside = jnp.asarray(inside)
        expected = interest.expected_trace(mean, variance, jnp.ones(25), inside, blur=0.1)
        return np.asarray(interest.trace(mean, variance, inside)), np.asarray(expected)

    for told in traces(inside):
        np.testing.assert_array_equal(np.isfinite(told), others)
    np.testing.assert_allclose(traces(inside)[0][others], np.asarray(whole)[others], rtol=1e-6)
    assert all(np.isfinite(told).all() for told in traces(inside & (np.arange(25) != point)))
    assert interest.area(mean, variance, jnp.asarray(inside))[row, point]
    if broken == "variance":
        assert np.isnan(trace(variance[row], interest.area(mean, variance, jnp.asarray(inside))[row]))


@given(hnp.arrays(np.float32, 6, elements=st.floats(0, 2.0**20, width=32, allow_subnormal=False)), st.integers(0, 5))
def test_a_score_that_is_not_a_number_is_never_the_best(scores, index):
    rest = np.delete(scores, index)
    scores[index] = np.nan
    assert np.nanmin(scores) == scores[int(jnp.argmin(to_rank(jnp.asarray(scores))))] == rest.min()
    assert np.isfinite(to_rank(jnp.full(3, jnp.nan))).all()  # and yet better than one that is barred by inf


@given(values, spreads, hnp.arrays(bool, 25), st.sampled_from(["std", "variance"]))
def test_the_expected_trace_without_spread_becomes_the_trace(mean, variance, inside, rule):
    """Away from the border of the area a small blur changes nothing; a large one counts every point half."""
    interest = Interest(0.4, 1.0, rule)
    bound = np.asarray(interest.bound(jnp.asarray(mean), jnp.asarray(variance)))
    clear = jnp.asarray(inside & (np.abs(bound - 0.4) > 0.02).all(axis=0))
    mean, variance, known = jnp.asarray(mean), jnp.asarray(variance), jnp.ones(25)
    sharp = interest.expected_trace(mean, variance, known, clear, spread=0.0, blur=1e-3)
    np.testing.assert_allclose(sharp, interest.trace(mean, variance, clear), rtol=1e-4, atol=1e-4)
    half = 0.5 * np.where(inside, variance, 0.0).sum(axis=1)
    blurred = interest.expected_trace(mean, variance, known, jnp.asarray(inside), spread=0.0, blur=1e5)
    np.testing.assert_allclose(blurred, half, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("spread", [1.0, 0.5])
def test_the_expected_trace_is_the_mean_over_what_may_be_measured(spread):
    """Against the trace of drawn means: normal, with the variance that the measurement takes away."""
    rng = np.random.default_rng(0)
    known, mean = rng.uniform(0.2, 1.0, 25).astype(np.float32), rng.normal(size=25).astype(np.float32) * 0.5
    variance = known * rng.uniform(0.05, 0.95, 25).astype(np.float32)
    drawn = mean + spread * np.sqrt(known - variance) * rng.normal(size=(40_000, 25)).astype(np.float32)
    interest, inside = Interest(), jnp.ones(25, bool)
    traces = np.asarray(interest.trace(jnp.asarray(drawn), jnp.broadcast_to(variance, drawn.shape), inside))
    found = interest.expected_trace(
        jnp.asarray(mean), jnp.asarray(variance), jnp.asarray(known), inside, spread=spread, blur=1e-4
    )
    assert float(found) == pytest.approx(traces.mean(), abs=5 * traces.std() / np.sqrt(len(traces)))


def test_the_expected_trace_has_a_slope_where_nothing_is_unknown():
    interest = Interest()

    def value(variance):
        return interest.expected_trace(
            jnp.full(3, 0.5), variance, jnp.zeros(3), jnp.ones(3, bool), spread=0.3, blur=0.02
        )

    slope = np.asarray(jax.grad(value)(jnp.zeros(3)))
    assert np.isfinite(slope).all()
    assert (slope > 0).all()


def test_a_variance_rounded_below_zero_does_not_drop_a_point():
    assert bool(Interest().area(jnp.array(0.5), jnp.array(-1e-9), EVERYWHERE))
    assert float(Interest().bound(jnp.array(0.5), jnp.array(-1e-9))) == 0.5


def test_rmse_counts_the_survey_area_only():
    mean, truth = jnp.array([0.0, 1.0, 2.0, 9.0]), jnp.array([1.0, 1.0, 4.0, 0.0])
    inside = jnp.array([True, True, True, False])
    assert float(rmse(mean, truth, inside)) == pytest.approx(np.sqrt(5 / 3))
    assert float(rmse(mean, truth, jnp.zeros(4, bool))) == 0.0


@given(SEEDS, st.sampled_from([0.01, 1.0]))
def test_mutual_information_is_half_the_log_determinant_and_never_negative(seed, scale):
    rng = np.random.default_rng(seed)
    x, mask = rng.random((6, 2)), rng.random(6) < 0.5
    area = rng.random(25) < rng.random()
    with jax.enable_x64(True):
        belief = condition_(Matern32(0.45), *map(jnp.asarray, (x, np.zeros(6), mask, QUERY)))
        found = float(information_(belief, jnp.asarray(area), scale))
    matern = Matern(0.45, nu=1.5)
    joint = np.asarray(matern(np.concatenate([x[mask], QUERY[area]])))
    count = mask.sum()
    gram, cross, prior = joint[:count, :count] + 1e-6 * np.eye(count), joint[:count, count:], joint[count:, count:]
    covariance = prior - cross.T @ np.linalg.solve(gram, cross)
    expected = 0.5 * np.linalg.slogdet(np.eye(area.sum()) + scale * covariance)[1]
    assert found == pytest.approx(expected, abs=1e-8)
    assert found >= 0.0


@given(SEEDS)
def test_mutual_information_in_float32(seed):
    rng = np.random.default_rng(seed)
    x, area = rng.random((6, 2)), jnp.asarray(rng.random(25) < 0.7)
    x, query = jnp.asarray(x, jnp.float32), jnp.asarray(QUERY, jnp.float32)
    masks = (jnp.zeros(6, bool), jnp.ones(6, bool))
    beliefs = (condition_(Matern32(0.45), x, jnp.zeros(6), mask, query) for mask in masks)
    before, after = (float(information_(belief, area)) for belief in beliefs)
    # What is left to learn shrinks as measurements come in, and is never less than nothing.
    assert -1e-6 <= after <= before + 1e-6
