"""The policy network: an encoder over all roadmap nodes, and a decoder that scores the next waypoints.

Source: Yang et al. 2023, Sec. IV-D. Encoder and decoder are apart: one encoding of about 0.1 GFLOP (200 nodes) serves
any number of decoding steps of about 1 MFLOP each. Written for one agent; `jax.vmap` over missions and trajectories.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.errors import InputError
from maipp.policy.attention import DecoderLayer, EncoderLayer, Pointer
from maipp.policy.features import NODE_FEATURES
from maipp.policy.layers import FeedForward, LayerNorm, Linear, LSTMCell
from maipp.typing import Array, Bool, Float, Index, Int, Key, Mask, Scalar


class Memory(NamedTuple):
    """What the network remembers of the executed trajectory: the states of its LSTM."""

    hidden: Float[Array, " d"]
    cell: Float[Array, " d"]


class Prepared(NamedTuple):
    """All that decoding steps need of one encoding."""

    embeddings: Float[Array, "n d"]  # zero where a node is not valid
    keys: Float[Array, "h n c"]  # of the decoder's cross-attention
    values: Float[Array, "h n c"]
    valid: Bool[Array, " n"] | None  # None where all nodes are


class PolicyNetwork(eqx.Module):
    """Maps an agent's observation to logits over its neighbours and to a value; any number of nodes and neighbours.

    `use_intent=False` ignores the others' intent (CAtNIPP). All results are float32, whatever the inputs.
    """

    embed: Linear
    embed_encoding: Linear
    encoder: tuple[EncoderLayer, ...]
    encoder_norm: LayerNorm
    embed_state: Linear
    trajectory: LSTMCell
    decoder: DecoderLayer
    decoder_norm: LayerNorm
    pointer: Pointer
    value: FeedForward
    width: int = eqx.field(static=True)
    heads: int = eqx.field(static=True)
    encoder_layers: int = eqx.field(static=True)
    encoding_dimensions: int = eqx.field(static=True)
    use_intent: bool = eqx.field(static=True)

    def __init__(
        self,
        key: Key,
        *,
        width: int = 128,
        heads: int = 8,
        encoder_layers: int = 1,
        encoding_dimensions: int = 32,
        use_intent: bool = True,
    ) -> None:
        """A new network with random weights.

        Raises InputError for a size below 1 and for a width that is not a multiple of the heads.
        """
        sizes = {"width": width, "heads": heads}
        sizes |= {"encoder_layers": encoder_layers, "encoding_dimensions": encoding_dimensions}
        for name, size in sizes.items():
            if size < 1:
                raise InputError(f"{name} is {size}; it must be at least 1")
        if width % heads:
            raise InputError(f"width is {width} and heads is {heads}; the width must be a multiple of the heads")
        self.width, self.heads, self.encoder_layers = width, heads, encoder_layers
        self.encoding_dimensions, self.use_intent = encoding_dimensions, use_intent
        keys = iter(jax.random.split(key, 7 + encoder_layers))
        self.embed = Linear(next(keys), len(NODE_FEATURES), width)
        self.embed_encoding = Linear(next(keys), encoding_dimensions, width, bias=False)
        self.embed_state = Linear(next(keys), width + 2, width)
        self.trajectory = LSTMCell(next(keys), width, width)
        self.decoder = DecoderLayer(next(keys), width, heads)
        self.pointer = Pointer(next(keys), width)
        self.value = FeedForward(next(keys), width, width, 1)
        self.encoder = tuple(EncoderLayer(key, width, heads) for key in keys)
        self.encoder_norm, self.decoder_norm = LayerNorm(width), LayerNorm(width)

    @property
    def architecture(self) -> dict[str, int | bool]:
        """The arguments that make a network of this shape."""
        names = ("width", "heads", "encoder_layers", "encoding_dimensions", "use_intent")
        return {name: getattr(self, name) for name in names}

    def initial_memory(self) -> Memory:
        """The memory at the start of a mission."""
        return Memory(jnp.zeros(self.width, jnp.float32), jnp.zeros(self.width, jnp.float32))

    def encode(
        self,
        features: Float[Array, "n 5"],
        encoding: Float[Array, "n {self.encoding_dimensions}"],
        valid: Mask | None = None,
    ) -> Float[Array, "n d"]:
        """The node embeddings, from `node_features` and the `laplacian_encoding` of the roadmap.

        Nodes that are not `valid` (padding) have no influence, whatever they hold, and embeddings of zero.
        """
        features, encoding = features.astype(jnp.float32), encoding.astype(jnp.float32)
        if not self.use_intent:
            features = features.at[:, NODE_FEATURES.index("intent")].set(0.0)
        count = features.shape[0]
        if valid is not None:
            # Before anything is computed: a NaN times a gradient of zero would still be a NaN.
            features, encoding = jnp.where(valid[:, None], features, 0.0), jnp.where(valid[:, None], encoding, 0.0)
            count = jnp.sum(valid)
        # Entries of a unit eigenvector shrink as 1 / sqrt(n): scaled, they are of size one on roadmaps of any size.
        x = self.embed(features) + self.embed_encoding(encoding * jnp.sqrt(jnp.float32(count)))
        for layer in self.encoder:
            x = layer(x, valid)
        x = self.encoder_norm(x)
        return x if valid is None else jnp.where(valid[:, None], x, 0.0)

    def prepare(self, embeddings: Float[Array, "n d"], valid: Mask | None = None) -> Prepared:
        """What all decoding steps from these embeddings share; `valid` as given to `encode`."""
        return Prepared(embeddings, *self.decoder.attention.prepare(embeddings), valid)

    def decode(
        self,
        prepared: Prepared,
        current: Index,
        neighbours: Int[Array, " k"],
        allowed: Bool[Array, " k"],
        neighbour_std: Float[Array, " k"],
        remaining: Scalar | float,
        threshold: Scalar | float,
        memory: Memory,
    ) -> tuple[Float[Array, " k"], Float[Array, ""], Memory]:
        """The logits of the neighbours, the value of the state, and the memory after this step.

        `current` and `neighbours` are node indices, `remaining` the budget left in longest sides of the extent,
        `threshold` that of the high-interest area. `neighbour_std` is what it is now, which on a virtual step is less
        than when the nodes were encoded. Logits are -inf, and pass no gradient, where a neighbour is not `allowed`;
        value and memory are finite even if none is.
        """
        state = jnp.stack([jnp.asarray(threshold, jnp.float32), jnp.asarray(remaining, jnp.float32)])
        x = self.embed_state(jnp.concatenate([prepared.embeddings[current], state]))
        memory = Memory(*self.trajectory(x, *memory))
        x = self.decoder(memory.hidden, prepared.keys, prepared.values, prepared.valid)
        query = self.decoder_norm(x)
        std = neighbour_std.astype(jnp.float32)
        logits = self.pointer(query, prepared.embeddings, neighbours, allowed, std)
        return logits, self.value(query)[0], memory
