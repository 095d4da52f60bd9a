"""The plain layers of the policy network, applied along the last axis whatever axes come before.

Weights are stored inputs first: `x @ weight` keeps the axes of a batch in front, where `weight @ x` would leave them
behind and cost a transposed copy per layer. All weights are float32.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.typing import Array, Float, Key

_EPSILON = 1e-5  # keeps the normalisation of a constant vector finite


class Linear(eqx.Module):
    """An affine map, or a linear one without its bias."""

    weight: Float[Array, "i o"]
    bias: Float[Array, " o"] | None

    def __init__(self, key: Key, inputs: int, outputs: int, *, bias: bool = True, gain: float = 1.0) -> None:
        # Variance gain^2 / inputs: outputs are as large as inputs, times the gain.
        self.weight = gain / inputs**0.5 * jax.random.normal(key, (inputs, outputs), jnp.float32)
        self.bias = jnp.zeros(outputs, jnp.float32) if bias else None

    def __call__(self, x: Float[Array, "*b i"]) -> Float[Array, "*b o"]:
        """The image of x."""
        y = x @ self.weight
        return y if self.bias is None else y + self.bias


class LayerNorm(eqx.Module):
    """Layer normalisation: zero mean and unit variance over the last axis, then a learned scale and offset."""

    scale: Float[Array, " d"]
    offset: Float[Array, " d"]

    def __init__(self, width: int) -> None:
        self.scale = jnp.ones(width, jnp.float32)
        self.offset = jnp.zeros(width, jnp.float32)

    def __call__(self, x: Float[Array, "*b d"]) -> Float[Array, "*b d"]:
        """x, normalised."""
        centred = x - jnp.mean(x, axis=-1, keepdims=True)
        variance = jnp.mean(centred * centred, axis=-1, keepdims=True)
        return centred * jax.lax.rsqrt(variance + _EPSILON) * self.scale + self.offset


class FeedForward(eqx.Module):
    """A perceptron with one hidden layer of rectified units."""

    hidden: Linear
    output: Linear

    def __init__(self, key: Key, inputs: int, hidden: int, outputs: int) -> None:
        first, second = jax.random.split(key)
        self.hidden = Linear(first, inputs, hidden)
        self.output = Linear(second, hidden, outputs)

    def __call__(self, x: Float[Array, "*b i"]) -> Float[Array, "*b o"]:
        """The image of x."""
        return self.output(jax.nn.relu(self.hidden(x)))


class LSTMCell(eqx.Module):
    """One step of a long short-term memory (Hochreiter & Schmidhuber 1997), all gates in one product."""

    gates: Linear

    def __init__(self, key: Key, inputs: int, width: int) -> None:
        self.gates = Linear(key, inputs + width, 4 * width)

    def __call__(
        self, x: Float[Array, "*b i"], hidden: Float[Array, "*b d"], cell: Float[Array, "*b d"]
    ) -> tuple[Float[Array, "*b d"], Float[Array, "*b d"]]:
        """The next hidden state, which is also the output, and the next cell state."""
        gates = self.gates(jnp.concatenate([x, hidden], axis=-1))
        admit, forget, update, show = jnp.split(gates, 4, axis=-1)
        # + 1: a new network remembers rather than forgets.
        cell = jax.nn.sigmoid(forget + 1.0) * cell + jax.nn.sigmoid(admit) * jnp.tanh(update)
        return jax.nn.sigmoid(show) * jnp.tanh(cell), cell
