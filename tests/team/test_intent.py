"""The Gaussian intent: fits against NumPy, densities and maps against SciPy, divergences, invariants, gradients."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from jax.test_util import check_grads
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from maipp.team import (
    COVARIANCE_FLOOR,
    Intent,
    destination_intent,
    fit_intent,
    fuse_intents,
    intent_density,
    is_announced,
    matrix,
    no_intent,
    symmetric_kl,
    trajectory_intent,
)

# One shape for all examples, and compiled: a new shape would be a new compilation.
P, A, J, M, N = 12, 8, 5, 3, 40
fit_ = eqx.filter_jit(fit_intent)
destination_ = eqx.filter_jit(destination_intent)
trajectory_ = eqx.filter_jit(trajectory_intent)
density_ = eqx.filter_jit(intent_density)
fuse_ = eqx.filter_jit(fuse_intents)
divergence_ = eqx.filter_jit(symmetric_kl)

SEEDS = st.integers(0, 2**32 - 1)
SPREADS = st.sampled_from([1e-4, 0.02, 0.3, 1.0])  # from far below the floor's 1/28 to far above


def cloud(rng, spread, count=P):
    """Points around anywhere in the unit square, stretched along a random direction."""
    shear = rng.normal(size=(2, 2)) * spread
    return (rng.random(2) + rng.normal(size=(count, 2)) @ shear).astype(np.float32)


def floored(points):
    """Mean and floored covariance by eigendecomposition in float64."""
    points = np.asarray(points, np.float64)
    values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
    return points.mean(axis=0), vectors @ np.diag(np.maximum(values, COVARIANCE_FLOOR)) @ vectors.T


def gaussian(rng, far=0.0):
    """A random intent with the eigenvalues of its covariance in [floor, 100 floor], `far` from the unit square."""
    angle, values = rng.uniform(0, 2 * np.pi), COVARIANCE_FLOOR * 10 ** rng.uniform(0, 2, 2)
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    (xx, xy), (_, yy) = axes @ np.diag(values) @ axes.T
    return Intent(jnp.asarray(rng.random(2) + far, jnp.float32), jnp.asarray([xx, xy, yy], jnp.float32))


def stack(intents):
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *intents)


def exact(intent):
    """Mean and covariance matrix in float64, put together without the code under test."""
    xx, xy, yy = np.asarray(intent.covariance, np.float64)
    return np.asarray(intent.mean, np.float64), np.array([[xx, xy], [xy, yy]])


def log_densities(intents, points):
    """SciPy's log densities in float64, one row per intent."""
    points = np.asarray(points, np.float64)
    # SciPy's annotation of `cov` is that of its default, 1.
    return np.stack([multivariate_normal.logpdf(points, *exact(one)) for one in intents])  # pyright: ignore


def assert_same(found, expected, atol=1e-6):
    for got, right in zip(found, expected, strict=True):
        np.testing.assert_allclose(got, right, rtol=1e-4, atol=atol)


def test_the_message_is_five_numbers():
    intent = fit_(jnp.asarray(cloud(np.random.default_rng(0), 0.2)), jnp.ones(P, bool))
    assert sum(leaf.size for leaf in jax.tree.leaves(intent)) == 5


def test_a_wide_cloud_keeps_the_maximum_likelihood_covariance():
    points = np.random.default_rng(1).random((P, 2)).astype(np.float32)
    intent = fit_(jnp.asarray(points), jnp.ones(P, bool))
    assert_same(exact(intent), (points.mean(axis=0), np.cov(points.T.astype(np.float64), bias=True)))


@given(SEEDS, SPREADS, st.integers(1, P))
def test_fit_floors_the_eigenvalues_and_keeps_the_eigenvectors(seed, spread, count):
    rng = np.random.default_rng(seed)
    points, mask = cloud(rng, spread), rng.permutation(P) < count
    found = fit_(jnp.asarray(np.where(mask[:, None], points, np.nan)), jnp.asarray(mask))
    assert_same(exact(found), floored(points[mask]))
    np.testing.assert_array_equal(matrix(found), np.asarray(exact(found)[1], np.float32))
    small, large = np.linalg.eigvalsh(exact(found)[1])
    assert small >= COVARIANCE_FLOOR - 2 * np.finfo(np.float32).eps * large  # up to rounding of the entries


def test_points_along_a_diagonal_are_not_singular():
    line = np.linspace(0.0, 1.0, P, dtype=np.float32)
    _, covariance = exact(fit_(jnp.asarray(np.stack([line, line], axis=1)), jnp.ones(P, bool)))
    assert covariance[0, 0] > COVARIANCE_FLOOR  # where a floor on the variances alone would have stopped
    values, vectors = np.linalg.eigh(covariance)
    np.testing.assert_allclose(values, np.array([COVARIANCE_FLOOR, 2 * line.var()]), rtol=1e-4)
    np.testing.assert_allclose(np.abs(vectors), np.sqrt(0.5), rtol=1e-4)


def test_the_floor_can_be_scaled_with_the_domain():
    points, mask = np.random.default_rng(2).random((P, 2)).astype(np.float32) * 0.1, jnp.ones(P, bool)
    small, large = (fit_(jnp.asarray(points * size), mask, jnp.asarray(COVARIANCE_FLOOR * size**2)) for size in (1, 64))
    np.testing.assert_allclose(large.covariance, small.covariance * 64**2, rtol=1e-5)


@pytest.mark.parametrize("count", [1, 7, P])
def test_equal_points_have_the_floor_in_every_direction(count):
    points = jnp.full((P, 2), 0.25).at[:, 1].set(0.75)
    intent = fit_(points, jnp.arange(P) < count)
    np.testing.assert_array_equal(intent.mean, [0.25, 0.75])
    np.testing.assert_array_equal(intent.covariance, np.array([COVARIANCE_FLOOR, 0.0, COVARIANCE_FLOOR], np.float32))


def test_no_points_say_nothing():
    intent = fit_(jnp.ones((P, 2)), jnp.zeros(P, bool))
    assert not is_announced(intent)
    for got, right in zip(intent, no_intent(), strict=True):
        np.testing.assert_array_equal(got, right)
    several = stack([no_intent(), gaussian(np.random.default_rng(0)), intent])
    np.testing.assert_array_equal(is_announced(several), [False, True, False])
    assert matrix(several).shape == (3, 2, 2)


@given(SEEDS, SPREADS, st.floats(0, 2 * np.pi), st.floats(-2, 2), st.floats(-2, 2))
def test_fit_follows_rotations_and_translations(seed, spread, angle, right, up):
    points, everyone = cloud(np.random.default_rng(seed), spread), jnp.ones(P, bool)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mean, covariance = exact(fit_(jnp.asarray(points), everyone))
    moved = fit_(jnp.asarray(points @ turn.T + [right, up], jnp.float32), everyone)
    assert_same(exact(moved), (turn @ mean + [right, up], turn @ covariance @ turn.T), atol=3e-6)


@given(SEEDS, SPREADS)
def test_neither_the_order_of_trajectories_nor_that_of_points_matters(seed, spread):
    rng = np.random.default_rng(seed)
    trajectories, mask = cloud(rng, spread, A * J).reshape(A, J, 2), rng.random((A, J)) < 0.7
    mask[0, 0] = True
    order, steps = rng.permutation(A), rng.permutation(J)
    pair, shuffled = (jnp.asarray(trajectories), jnp.asarray(mask)), (trajectories[order], mask[order])
    assert_same(destination_(*map(jnp.asarray, shuffled)), destination_(*pair))
    assert_same(trajectory_(jnp.asarray(shuffled[0][:, steps]), jnp.asarray(shuffled[1][:, steps])), trajectory_(*pair))


@given(SEEDS, st.lists(st.integers(0, J), min_size=A, max_size=A))
@example(0, [0] * A)
@example(0, [J] + [0] * (A - 1))
def test_destinations_and_trajectories_of_different_lengths(seed, lengths):
    trajectories = np.random.default_rng(seed).random((A, J, 2)).astype(np.float32)
    mask = np.arange(J) < np.array(lengths)[:, None]
    padded = jnp.asarray(np.where(mask[..., None], trajectories, np.nan))
    destination, trajectory = destination_(padded, jnp.asarray(mask)), trajectory_(padded, jnp.asarray(mask))
    if not any(lengths):
        assert not is_announced(destination) and not is_announced(trajectory)
        return
    kept = [path[:length] for path, length in zip(trajectories, lengths, strict=True) if length]
    assert_same(exact(destination), floored([path[-1] for path in kept]))
    assert_same(exact(trajectory), floored(np.concatenate(kept)))


@given(SEEDS)
def test_trajectories_of_one_node_are_their_destinations(seed):
    rng = np.random.default_rng(seed)
    pair = jnp.asarray(cloud(rng, 0.2, A)[:, None]), jnp.asarray(rng.random((A, 1)) < 0.8)
    for one, other in zip(destination_(*pair), trajectory_(*pair), strict=True):
        np.testing.assert_array_equal(one, other)


@given(SEEDS)
def test_density_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    intent, points = gaussian(rng), rng.random((N, 2)).astype(np.float32)
    expected = np.exp(log_densities([intent], points)[0])
    np.testing.assert_allclose(density_(intent, jnp.asarray(points)), expected, rtol=2e-3, atol=1e-6)
    np.testing.assert_array_equal(density_(no_intent(), jnp.asarray(points)), np.zeros(N))


@given(SEEDS, st.lists(st.sampled_from(["heard", "told", "none"]), min_size=M, max_size=M), st.floats(0, 3))
@example(0, ["none", "told", "none"], 0.0)
@example(2848736149, ["heard"] * M, 0.0)  # here the quotient of the maximum by itself is 0.99999994
def test_the_map_sums_who_is_heard_and_has_told(seed, who, far):
    """It is in [0, 1] with a maximum of exactly 1, or zero where nobody counts; others have no influence."""
    rng = np.random.default_rng(seed)
    points = rng.random((N, 2)).astype(np.float32)
    agents = [gaussian(rng, far) for _ in range(M)]
    told = stack([no_intent() if state == "none" else agent for agent, state in zip(agents, who, strict=True)])
    heard = np.array([state != "told" for state in who])
    found = np.asarray(fuse_(told, jnp.asarray(heard), jnp.asarray(points)))
    speakers = [agent for agent, state in zip(agents, who, strict=True) if state == "heard"]
    if not speakers:
        np.testing.assert_array_equal(found, np.zeros(N))
        return
    assert found.min() >= 0.0 and found.max() == 1.0
    logs = logsumexp(log_densities(speakers, points), axis=0)
    np.testing.assert_allclose(found, np.exp(logs - np.max(logs)), rtol=2e-2, atol=1e-3)
    order = rng.permutation(M)
    again = fuse_(jax.tree.map(lambda leaf: leaf[order], told), jnp.asarray(heard[order]), jnp.asarray(points))
    np.testing.assert_allclose(again, found, rtol=1e-5, atol=1e-6)


def test_a_map_far_from_every_intent_is_still_right():
    narrow = jnp.array([COVARIANCE_FLOOR, 0.0, COVARIANCE_FLOOR])
    agents = [Intent(jnp.array([3.0, 3.0]), narrow), Intent(jnp.array([-2.0, 3.0]), narrow), no_intent()]
    side = np.linspace(0.0, 1.0, 8)[:5]
    points = np.stack(np.meshgrid(side, np.linspace(0.0, 1.0, 8)), axis=-1).reshape(-1, 2).astype(np.float32)
    for agent in agents:  # about 80 standard deviations away: nothing left in float32
        np.testing.assert_array_equal(density_(agent, jnp.asarray(points)), np.zeros(N))
    found = np.asarray(fuse_(stack(agents), jnp.ones(M, bool), jnp.asarray(points)))
    logs = logsumexp(log_densities(agents[:2], points), axis=0)
    assert found.max() == 1.0
    np.testing.assert_allclose(found, np.exp(logs - np.max(logs)), rtol=1e-2, atol=1e-3)


def divergence(a, b):
    """KL(a || b) in its usual form, float64."""
    (mean_a, a), (mean_b, b) = exact(a), exact(b)
    inverse, moved = np.linalg.inv(b), mean_b - mean_a
    logs = np.linalg.slogdet(b)[1] - np.linalg.slogdet(a)[1]
    return 0.5 * (np.trace(inverse @ a) + moved @ inverse @ moved - 2 + logs)


@given(SEEDS)
def test_divergence_is_symmetric_positive_and_zero_between_equals_only(seed):
    rng = np.random.default_rng(seed)
    a, b = gaussian(rng), gaussian(rng)
    assert float(divergence_(a, b)) == pytest.approx(divergence(a, b) + divergence(b, a), rel=1e-3)
    assert float(divergence_(b, a)) == pytest.approx(float(divergence_(a, b)), rel=1e-4)
    assert float(divergence_(a, a)) == 0.0
    near = Intent(a.mean, a.covariance * jnp.array([1.0, 1.0, 1.001]))
    # Of the order of 1e-6 nats: the usual form would lose all of it in float32.
    assert float(divergence_(a, near)) == pytest.approx(divergence(a, near) + divergence(near, a), rel=1e-2)
    assert float(divergence_(a, near)) > 0.0


def test_divergence_from_nothing_is_undefined():
    told = gaussian(np.random.default_rng(3))
    assert np.isnan(divergence_(told, no_intent())) and np.isnan(divergence_(no_intent(), told))


@eqx.filter_jit
@functools.partial(jax.grad, argnums=(0, 4))
def slopes(points, mask, others, heard, nodes):
    """Gradients, by the points of one agent and by the nodes, of the map and of that agent's own density."""
    intent = fit_intent(points, mask)
    fused = fuse_intents(jax.tree.map(lambda one, more: jnp.stack([one, *more]), intent, others), heard, nodes)
    return jnp.sum(fused) + jnp.sum(intent_density(intent, nodes))


@pytest.mark.parametrize("heard", [(True, True, True), (False, True, False), (False, False, False)])
@pytest.mark.parametrize("case", ["spread", "line", "equal", "one", "none"])
def test_gradients_are_finite_however_degenerate_the_points(case, heard):
    rng = np.random.default_rng(4)
    mask = np.arange(P) < {"one": 1, "none": 0}.get(case, P)
    points = {"line": rng.random((P, 1)) * [1, 1], "equal": np.full((P, 2), 0.5)}.get(case, rng.random((P, 2)))
    points = jnp.asarray(np.where(mask[:, None], points, np.nan), jnp.float32)
    others, nodes = stack([no_intent(), gaussian(rng)]), jnp.asarray(rng.random((N, 2)), jnp.float32)
    by_points, by_nodes = slopes(points, jnp.asarray(mask), others, jnp.asarray(heard), nodes)
    assert np.isfinite(by_points).all() and np.isfinite(by_nodes).all()
    assert np.any(by_points != 0) == mask.any()
    assert np.any(by_nodes != 0) == (mask.any() or heard[2])


def test_gradients_are_those_of_finite_differences():
    rng = np.random.default_rng(5)
    with jax.enable_x64(True):
        nodes, heard = jnp.asarray(rng.random((N, 2))), jnp.ones(2, bool)
        other = Intent(jnp.array([0.3, 0.6]), jnp.array([0.02, 0.005, 0.03]))

        def scores(points):
            intent = fit_intent(points, jnp.ones(P, bool))
            return fuse_intents(stack([intent, other]), heard, nodes).sum(), symmetric_kl(intent, other)

        # Wide, and flat enough for the floor to act on one of the two eigenvalues.
        for squash in ([1.0, 1.0], [1.0, 0.02]):
            check_grads(jax.jit(scores), (jnp.asarray(rng.random((P, 2)) * squash),), order=1, modes=["rev"])
