"""Networks for the planners that move by a policy: small ones, with choices that the tests can foretell."""

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from maipp.policy import PolicyNetwork, Prepared

SIZE = {"width": 16, "heads": 2, "encoding_dimensions": 4}


class CuriousNetwork(PolicyNetwork):
    """Prefers the neighbour with the highest standard deviation that it is shown; no draw can miss it."""

    def decode(self, prepared, current, neighbours, allowed, neighbour_std, remaining, threshold, memory):
        logits = jnp.where(allowed, 1e6 * neighbour_std.astype(jnp.float32), -jnp.inf)
        return logits, jnp.float32(0), memory


class FarSightedNetwork(PolicyNetwork):
    """Likewise, by the features of all nodes, which only `reencode` renews."""

    def encode(self, features, encoding, valid=None):
        return features.astype(jnp.float32)

    def prepare(self, embeddings, valid=None):
        return Prepared(embeddings, jnp.zeros((1, *embeddings.shape)), jnp.zeros((1, *embeddings.shape)), None)

    def decode(self, prepared, current, neighbours, allowed, neighbour_std, remaining, threshold, memory):
        return jnp.where(allowed, 1e6 * prepared.embeddings[neighbours, 3], -jnp.inf), jnp.float32(0), memory


@eqx.filter_jit
def new_network(kind, key):
    return kind(key, **SIZE)


@pytest.fixture(scope="session")
def tiny():
    """Sharper than a new one, whose logits hardly differ."""
    new = new_network(PolicyNetwork, jax.random.key(3))
    return eqx.tree_at(lambda n: n.pointer.query.weight, new, replace_fn=lambda w: 30 * w)


@pytest.fixture(scope="session")
def curious():
    return new_network(CuriousNetwork, jax.random.key(3))


@pytest.fixture(scope="session")
def far_sighted():
    return new_network(FarSightedNetwork, jax.random.key(3))
