"""Plans in the plane: legs stay in the domain and have the length they should."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from maipp.planners.plane.walks import bend, walk, walk_bent, within_leg

SEEDS = st.integers(0, 2**32 - 1)
EXTENT = (1.5, 0.8)
LEGS = 5

straight_ = jax.jit(lambda start, plans, steps: walk(start, plans, steps, EXTENT))
bent_ = jax.jit(lambda start, plans, steps: walk_bent(start, plans, steps, EXTENT))
bend_ = jax.jit(jax.vmap(lambda start, end, length: bend(start, end, length, EXTENT), in_axes=(0, 0, 0)))


def draw(seed):
    """A start, often on the border, and the lengths of the legs."""
    rng = np.random.default_rng(seed)
    start = np.clip(rng.uniform(-0.3, 1.3, 2), 0.0, 1.0) * EXTENT
    return rng, *(jnp.asarray(a, jnp.float32) for a in (start, rng.uniform(0.01, 0.3, LEGS)))


def lengths(start, points):
    way = np.concatenate([np.broadcast_to(start, (*points.shape[:-2], 1, 2)), points], axis=-2)
    return np.linalg.norm(np.diff(way, axis=-2), axis=-1)


def inside(points):
    return ((np.asarray(points) >= 0.0) & (np.asarray(points) <= np.asarray(EXTENT, np.float32))).all()


@given(SEEDS)
@example(2312)  # these went wrong where a sum that compiled code rounds in two ways decided about a turn
@example(2375)
def test_straight_legs_stay_in_the_domain_and_are_as_long_as_told(seed):
    rng, start, steps = draw(seed)
    plans = jnp.asarray(rng.uniform(-np.pi, np.pi, (64, LEGS)), jnp.float32)
    points = straight_(start, plans, steps)
    assert inside(points)
    np.testing.assert_allclose(lengths(start, points), np.broadcast_to(steps, (64, LEGS)), atol=1e-6)
    np.testing.assert_allclose(points, walk(start, plans, steps, EXTENT), atol=1e-5)


@pytest.mark.parametrize(
    ("heading", "end"),
    [(0.3, None), (np.pi - 0.3, (0.0, 0.2 + np.sqrt(0.04 - 0.01))), (0.3 - np.pi, (0.0, 0.2 - np.sqrt(0.04 - 0.01)))],
)
def test_a_leg_across_the_border_ends_on_it(heading, end):
    start, step = jnp.array([0.1, 0.2]), 0.2
    if end is None:
        end = start + step * np.array([np.cos(heading), np.sin(heading)])
    (point,) = straight_(start, jnp.array([heading]), jnp.array([step]))
    np.testing.assert_allclose(point, end, atol=1e-6)


@given(SEEDS)
def test_bent_legs_stay_in_the_domain_and_have_the_length_to_spend(seed):
    rng, start, steps = draw(seed)
    plans = jnp.asarray(rng.normal(size=(3, LEGS, 2)), jnp.float32)
    points = bent_(start, plans, steps)
    assert inside(points)
    assert (lengths(start, points) <= np.asarray(steps) + 1e-6).all()
    starts = jnp.concatenate([jnp.broadcast_to(start, (3, 1, 2)), points[:, :-1]], axis=1).reshape(-1, 2)
    length = jnp.broadcast_to(steps, (3, LEGS)).reshape(-1)
    corners = bend_(starts, points.reshape(-1, 2), length)
    assert inside(corners)
    way = np.linalg.norm(corners - starts, axis=-1) + np.linalg.norm(points.reshape(-1, 2) - corners, axis=-1)
    np.testing.assert_allclose(way, length, atol=1e-5)


def test_a_displacement_inside_the_domain_is_taken_as_it_is():
    plan = jnp.array([[0.5, 0.0], [0.0, 3.0]])
    points = bent_(jnp.array([0.5, 0.4]), plan, jnp.array([0.2, 0.2, 0.2, 0.2, 0.2])[:2])
    np.testing.assert_allclose(points, [[0.6, 0.4], [0.6, 0.6]], atol=1e-6)


def test_a_leg_that_goes_nowhere_comes_back():
    here = jnp.array([0.0, 0.0])
    corner = bend(here, here, jnp.asarray(0.2), EXTENT)
    assert float(jnp.linalg.norm(corner)) > 0.0999 and inside(corner)


def test_slopes_are_finite_at_no_displacement_and_at_the_longest():
    plans = jnp.array([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]])
    assert np.isfinite(jax.jacobian(within_leg)(plans)).all()
    slope = jax.grad(lambda plans: jnp.sum(walk_bent(jnp.zeros(2), plans, jnp.full(3, 0.2), EXTENT) ** 2))(plans)
    assert np.isfinite(slope).all()
