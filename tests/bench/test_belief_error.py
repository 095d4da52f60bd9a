"""The reference that beliefs are held against is the posterior, and what fits the capacity has next to no error."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32, condition
from maipp.bench.belief_error import belief_error, exact_moments, walks
from maipp.bench.scaling import add_missing
from maipp.scenario import Scenario


def test_the_reference_is_the_posterior_in_float64():
    rng = np.random.default_rng(0)
    x, y, query = rng.random((30, 2)), rng.random(30), rng.random((20, 2))
    found = exact_moments(Scenario(length_scale=0.3, signal_variance=2.0, noise=1e-4), x, y, query)
    with jax.enable_x64(True):
        known = jnp.ones(len(y), bool)
        wanted = condition(Matern32(0.3, 2.0), jnp.asarray(x), jnp.asarray(y), known, jnp.asarray(query), 1e-4)
        for a, b in zip(found, (wanted.mean, wanted.variance), strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)


def test_beyond_the_capacity_the_error_is_small_but_there():
    within = belief_error(200, 0.2, 0.25, surveys=2, seed=0)
    beyond = belief_error(200, 0.2, 0.25, surveys=2, seed=0, capacity=40)
    assert within.measurements == beyond.measurements == 200 and within.trace == beyond.trace
    assert abs(within.error) <= abs(within.error_worst) < 1e-3
    assert 0 < beyond.error < 0.05 and beyond.error_se > 0


def test_kinds_that_are_done_are_not_measured_again():
    measure, kinds = partial(belief_error, surveys=1, seed=0), [(100, 0.2, 0.4), (100, 0.2, 0.25)]
    found, told = [], []
    add_missing(found, kinds[1:], measure, told.append)
    first = found[0]
    add_missing(found, kinds, measure, told.append)
    assert [error.point for error in found] == kinds[::-1] and found[0] is first and told == found


def test_walks_stay_in_the_domain_and_measure_at_every_interval():
    visited = walks(np.random.default_rng(0), 50, 40, 0.2)
    assert visited.shape == (50, 40, 2) and (visited >= 0).all() and (visited <= 1).all()
    steps = np.linalg.norm(np.diff(visited, axis=1), axis=-1)
    assert (steps <= 0.2 + 1e-12).all()
    assert np.isclose(steps, 0.2).mean() > 0.4  # the others are mirrored at a border, where many linger
