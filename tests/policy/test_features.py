"""The node features are the paper's, relative to the agent and to the size of the domain."""

import jax.numpy as jnp
import numpy as np

from maipp.policy import node_features


def test_columns_and_scale():
    nodes, position = jnp.array([[1.0, 2.0], [4.0, 0.0]]), jnp.array([1.0, 1.0])
    found = node_features(
        nodes, position, jnp.array([0.1, 0.2]), jnp.array([0.3, 0.4]), jnp.array([0.5, 0.6]), (4.0, 2.0)
    )
    np.testing.assert_allclose(found, [[0, 0.25, 0.1, 0.3, 0.5], [0.75, -0.25, 0.2, 0.4, 0.6]], rtol=1e-6)


def test_neither_place_nor_size_of_the_domain_matters():
    rng = np.random.default_rng(0)
    nodes, position, beliefs = rng.random((6, 2)), rng.random(2), rng.random((3, 6))
    mean, std, intent = map(jnp.asarray, beliefs)
    here, moved = (
        node_features(jnp.asarray(at + size * nodes), jnp.asarray(at + size * position), mean, std, intent, extent)
        for at, size, extent in ((0.0, 1.0, (1.0, 0.5)), (3.0, 8.0, (8.0, 4.0)))
    )
    np.testing.assert_allclose(here, moved, atol=1e-5)
