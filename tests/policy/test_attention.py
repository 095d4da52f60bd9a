"""Attention against its definition, head by head."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import softmax

from maipp.policy.attention import LOGIT_BOUND

HEADS, WIDTH, NODES = 4, 16, 12


def by_definition(query, keys, values, valid):
    """softmax(q K^T / sqrt(c)) V over the valid keys, one head after the other."""
    mixed = []
    for q, k, v in zip(*(np.split(np.asarray(a), HEADS, axis=-1) for a in (query, keys, values)), strict=True):
        scores = q @ k[valid].T / np.sqrt(q.shape[-1])
        mixed.append(softmax(scores, axis=-1) @ v[valid])
    return np.concatenate(mixed, axis=-1)


@pytest.fixture
def nodes():
    return np.random.default_rng(1).normal(size=(NODES, WIDTH)).astype(np.float32)


@pytest.fixture
def valid():
    return np.arange(NODES) % 3 != 1


def test_self_attention(network, nodes, valid):
    layer = network.encoder[0].attention
    query, keys, values = np.split(nodes @ np.asarray(layer.projection.weight), 3, axis=-1)
    expected = by_definition(query, keys, values, valid) @ np.asarray(layer.output.weight)
    np.testing.assert_allclose(layer(jnp.asarray(nodes), jnp.asarray(valid)), expected, atol=1e-5)


def test_cross_attention(network, nodes, valid):
    layer = network.decoder.attention
    x = nodes[3] * 2
    fused = nodes @ np.asarray(layer.keys_values.weight)
    query = x @ np.asarray(layer.query.weight)
    expected = by_definition(query, fused[:, :WIDTH], fused[:, WIDTH:], valid) @ np.asarray(layer.output.weight)
    keys, values = layer.prepare(jnp.asarray(nodes))
    found = layer(jnp.asarray(x), keys, values, jnp.asarray(valid))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_pointer(network, nodes):
    layer, x = network.pointer, nodes[0] * 3
    neighbours, std = np.array([5, 2, 9, 4], np.int32), np.array([0.9, 0.1, 0.5, 0.3], np.float32)
    allowed = np.array([True, True, False, True])
    candidates = nodes[neighbours] + std[:, None] * np.asarray(layer.std.weight)
    keys = candidates @ np.asarray(layer.key.weight)
    scores = keys @ (x @ np.asarray(layer.query.weight)) / np.sqrt(WIDTH)
    expected = np.where(allowed, LOGIT_BOUND * np.tanh(scores), -np.inf)
    found = layer(*map(jnp.asarray, (x, nodes, neighbours, allowed, std)))
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
