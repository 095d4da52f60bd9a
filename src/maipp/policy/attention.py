"""Attention layers: among all nodes, from one query to all nodes, and the pointer to a neighbour.

Source: Yang et al. 2023, Sec. IV-D; Vaswani et al. 2017; Vinyals et al. 2015. Layers normalise their input, not their
sum ("pre-norm"), which trains without a warm-up.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from maipp.policy.layers import FeedForward, LayerNorm, Linear
from maipp.typing import Array, Bool, Float, Int, Key, Mask

LOGIT_BOUND = 10.0  # C: no action falls below e^-2C of the likeliest one, so all stay explored (Bello et al. 2016)
_POINTER_GAIN = 0.01  # a new policy is all but uniform over the neighbours, and explores


def attend(
    query: Float[Array, "h q c"], keys: Float[Array, "h n c"], values: Float[Array, "h n c"], valid: Mask | None = None
) -> Float[Array, "h q c"]:
    """For every query of every head the mixture of the values of the valid nodes, by scaled dot products.

    Nodes that are not valid have weights of exactly zero. Without any valid node the weights are uniform.
    """
    scores = jnp.einsum("hqc,hnc->hqn", query / math.sqrt(query.shape[-1]), keys)
    if valid is not None:
        scores = jnp.where(valid, scores, jnp.finfo(scores.dtype).min)  # -inf would give NaN without any valid node
    weights = jnp.exp(scores - lax.stop_gradient(jnp.max(scores, axis=-1, keepdims=True)))
    # A softmax, normalised after mixing: one pass less over the n x n weights, the largest array of an encoding.
    return jnp.einsum("hqn,hnc->hqc", weights, values) / jnp.sum(weights, axis=-1, keepdims=True)


def split_heads(fused: Float[Array, "n pd"], parts: int, heads: int) -> Float[Array, "{parts} {heads} n c"]:
    """The `parts` of a fused projection, heads first: one copy here spares every product its own."""
    return jnp.transpose(fused.reshape(len(fused), parts, heads, -1), (1, 2, 0, 3))


class SelfAttention(eqx.Module):
    """Multi-head attention of n nodes among each other."""

    projection: Linear  # queries, keys and values of all heads in one product
    output: Linear
    heads: int = eqx.field(static=True)

    def __init__(self, key: Key, width: int, heads: int) -> None:
        first, second = jax.random.split(key)
        self.projection = Linear(first, width, 3 * width, bias=False)
        self.output = Linear(second, width, width, bias=False)
        self.heads = heads

    def __call__(self, x: Float[Array, "n d"], valid: Mask | None = None) -> Float[Array, "n d"]:
        """For each node a mixture of the values of the valid nodes."""
        query, keys, values = split_heads(self.projection(x), 3, self.heads)
        mixed = attend(query, keys, values, valid)
        return self.output(jnp.transpose(mixed, (1, 0, 2)).reshape(x.shape))


class CrossAttention(eqx.Module):
    """Multi-head attention of one query to n nodes, whose keys and values are computed once for many queries."""

    query: Linear
    keys_values: Linear
    output: Linear
    heads: int = eqx.field(static=True)

    def __init__(self, key: Key, width: int, heads: int) -> None:
        first, second, third = jax.random.split(key, 3)
        self.query = Linear(first, width, width, bias=False)
        self.keys_values = Linear(second, width, 2 * width, bias=False)
        self.output = Linear(third, width, width, bias=False)
        self.heads = heads

    def prepare(self, nodes: Float[Array, "n d"]) -> tuple[Float[Array, "h n c"], Float[Array, "h n c"]]:
        """The keys and the values of the nodes."""
        keys, values = split_heads(self.keys_values(nodes), 2, self.heads)
        return keys, values

    def __call__(
        self, x: Float[Array, " d"], keys: Float[Array, "h n c"], values: Float[Array, "h n c"], valid: Mask | None
    ) -> Float[Array, " d"]:
        """A mixture of the values of the valid nodes."""
        query = self.query(x).reshape(self.heads, 1, -1)
        return self.output(attend(query, keys, values, valid).reshape(x.shape))


class EncoderLayer(eqx.Module):
    """Self-attention and a feed-forward network, each added to what it is given."""

    attention_norm: LayerNorm
    attention: SelfAttention
    feed_forward_norm: LayerNorm
    feed_forward: FeedForward

    def __init__(self, key: Key, width: int, heads: int) -> None:
        first, second = jax.random.split(key)
        self.attention_norm, self.feed_forward_norm = LayerNorm(width), LayerNorm(width)
        self.attention = SelfAttention(first, width, heads)
        self.feed_forward = FeedForward(second, width, 4 * width, width)

    def __call__(self, x: Float[Array, "n d"], valid: Mask | None = None) -> Float[Array, "n d"]:
        """The nodes' vectors, each informed by those of the valid nodes."""
        x = x + self.attention(self.attention_norm(x), valid)
        return x + self.feed_forward(self.feed_forward_norm(x))


class DecoderLayer(eqx.Module):
    """Cross-attention and a feed-forward network, each added to what it is given."""

    attention_norm: LayerNorm
    attention: CrossAttention
    feed_forward_norm: LayerNorm
    feed_forward: FeedForward

    def __init__(self, key: Key, width: int, heads: int) -> None:
        first, second = jax.random.split(key)
        self.attention_norm, self.feed_forward_norm = LayerNorm(width), LayerNorm(width)
        self.attention = CrossAttention(first, width, heads)
        self.feed_forward = FeedForward(second, width, 4 * width, width)

    def __call__(
        self, x: Float[Array, " d"], keys: Float[Array, "h n c"], values: Float[Array, "h n c"], valid: Mask | None
    ) -> Float[Array, " d"]:
        """The query's vector, informed by those of the valid nodes."""
        x = x + self.attention(self.attention_norm(x), keys, values, valid)
        return x + self.feed_forward(self.feed_forward_norm(x))


class Pointer(eqx.Module):
    """Single-head attention whose scores over the neighbours are the policy's logits (Vinyals et al. 2015).

    Neighbour j is represented by its embedding plus a learned projection of its current standard deviation, so that one
    encoding serves many virtual steps while the uncertainty falls.
    """

    query: Linear
    key: Linear
    std: Linear

    def __init__(self, key: Key, width: int) -> None:
        first, second, third = jax.random.split(key, 3)
        self.query = Linear(first, width, width, bias=False, gain=_POINTER_GAIN)
        self.key = Linear(second, width, width, bias=False)
        self.std = Linear(third, 1, width, bias=False)

    def __call__(
        self,
        x: Float[Array, " d"],
        nodes: Float[Array, "n d"],
        neighbours: Int[Array, " k"],
        allowed: Bool[Array, " k"],
        neighbour_std: Float[Array, " k"],
    ) -> Float[Array, " k"]:
        """Logits in [-C, C], -inf where a neighbour is not allowed."""
        # q . W^K (e + s w) = (W^K^T q) . e + s (W^K^T q) . w: moving the key projection to the query leaves nothing to
        # be done per node but a product, and gathering k scores costs less than gathering k embeddings.
        query = self.query(x) @ self.key.weight.T / math.sqrt(len(x))
        std = jnp.where(allowed, neighbour_std, 0.0)  # whatever stands in a masked slot has no gradient either
        scores = (query @ nodes.T)[neighbours] + std * (query @ self.std.weight[0])
        return jnp.where(allowed, LOGIT_BOUND * jnp.tanh(scores), -jnp.inf)
