"""A small network, and random observations for it."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.policy import PolicyNetwork

SMALL: dict[str, Any] = {"width": 16, "heads": 4, "encoder_layers": 2, "encoding_dimensions": 6}


@pytest.fixture(scope="session")
def network():
    """Sharper than a new one, whose logits hardly differ."""
    new = PolicyNetwork(jax.random.key(0), **SMALL)
    return eqx.tree_at(lambda n: n.pointer.query.weight, new, replace_fn=lambda w: 100 * w)


@pytest.fixture(scope="session")
def draw():
    """A function that draws an observation of n nodes and k neighbours."""

    def observation(seed: int, n: int = 12, k: int = 5) -> dict:
        rng = np.random.default_rng(seed)
        allowed = rng.random(k) < 0.6
        allowed[rng.integers(k)] = True
        return {
            "features": rng.normal(size=(n, 5)).astype(np.float32),
            "encoding": (rng.normal(size=(n, 6)) / n**0.5).astype(np.float32),
            "valid": np.ones(n, bool),
            "current": np.int32(rng.integers(n)),
            "neighbours": rng.permutation(n)[:k].astype(np.int32),
            "allowed": allowed,
            "std": rng.random(k).astype(np.float32),
            "remaining": np.float32(rng.random()),
            "threshold": np.float32(0.4),
        }

    return observation


def outcome(network, seen, memory):
    """Embeddings, logits, value and memory for an observation that `draw` drew."""
    embeddings = network.encode(seen["features"], seen["encoding"], seen["valid"])
    prepared = network.prepare(embeddings, seen["valid"])
    state = (seen["current"], seen["neighbours"], seen["allowed"], seen["std"], seen["remaining"], seen["threshold"])
    return embeddings, *network.decode(prepared, *state, memory)


@pytest.fixture(scope="session")
def run():
    """`outcome`, compiled, from the memory given or the initial one."""
    compiled = eqx.filter_jit(lambda network, seen, memory: outcome(network, jax.tree.map(jnp.asarray, seen), memory))
    return lambda network, seen, memory=None: compiled(network, seen, memory or network.initial_memory())
