"""Counting what others told: all of a little, the nearest of much."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32, condition, extend
from maipp.planners.announced.announced_measurements import MOST_COUNTED, count_announced

QUERY = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
NEAR = jnp.asarray([0.2, 0.3])


def belief():
    x = jnp.asarray([[0.1, 0.2], [0.8, 0.7]])
    return condition(
        Matern32(0.45), x, jnp.asarray([0.3, 0.6]), jnp.ones(2, bool), jnp.asarray(QUERY, jnp.float32), 1e-4
    )


def told(count):
    rng = np.random.default_rng(count)
    return jnp.asarray(rng.random((count, 2)), jnp.float32), jnp.asarray(rng.random(count) < 0.9)


@eqx.filter_jit
def counted(belief, points, valid, near: jax.Array | None = NEAR):
    return count_announced(belief, points, valid, near=near, virtual_value="mean")


def test_a_little_is_counted_as_it_is():
    points, valid = told(MOST_COUNTED)
    wanted = eqx.filter_jit(extend)(belief(), points, valid)
    assert eqx.tree_equal(counted(belief(), points, valid), wanted)


def test_of_much_the_nearest_are_counted():
    points, valid = told(3 * MOST_COUNTED)
    found = counted(belief(), points, valid)
    assert found.x.shape == (2 + MOST_COUNTED, 2) and bool(found.mask.all())
    distance = np.where(valid, np.linalg.norm(points - NEAR, axis=1), np.inf)
    nearest = np.sort(distance)[:MOST_COUNTED]
    np.testing.assert_allclose(np.sort(np.linalg.norm(found.x[2:] - NEAR, axis=1)), nearest, atol=1e-6)


def test_without_a_place_all_are_counted():
    points, valid = told(3 * MOST_COUNTED)
    assert counted(belief(), points, valid, None).x.shape == (2 + 3 * MOST_COUNTED, 2)


def test_who_is_not_heard_is_not_counted_in_a_crowd_either():
    points, _ = told(3 * MOST_COUNTED)
    found = counted(belief(), points, jnp.zeros(len(points), bool))
    np.testing.assert_allclose(found.variance, jax.device_get(belief().variance), atol=1e-6)
