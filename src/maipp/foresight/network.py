"""The network of the learned foresight: convolutions on a lattice at two resolutions, told a few numbers of the whole.

Written for one belief; `jax.vmap` over missions and samples. Everything that it is given and gives is in units of the
fitted foresight, whose answer is its zero: a network whose last layer is zero corrects nothing.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from maipp.errors import InputError
from maipp.policy.layers import Linear
from maipp.typing import Array, Float, Key

_LEAST_CELLS = 4

# The corrections are kept within: of the mean, in deviations; of the logarithm of the deviation.
_MOST_SHIFT, _MOST_STRETCH = 4.0, 2.0


class Convolution(eqx.Module):
    """A 3 x 3 convolution with zeros beyond the border."""

    weight: Float[Array, "3 3 i o"]
    bias: Float[Array, " o"]
    stride: int = eqx.field(static=True)

    def __init__(self, key: Key, inputs: int, outputs: int, *, stride: int = 1, gain: float = 1.0) -> None:
        scale = gain * (2.0 / (9 * inputs)) ** 0.5  # of layers before rectified units
        self.weight = scale * jax.random.normal(key, (3, 3, inputs, outputs), jnp.float32)
        self.bias = jnp.zeros(outputs, jnp.float32)
        self.stride = stride

    def __call__(self, x: Float[Array, "h w i"]) -> Float[Array, "k l o"]:
        """The image of x, every `stride`-th point of it, the first and the last included where their number is odd."""
        padding = ((1, 1), (1, 1))
        layout = ("NHWC", "HWIO", "NHWC")
        strides = (self.stride, self.stride)
        return lax.conv_general_dilated(x[None], self.weight, strides, padding, dimension_numbers=layout)[0] + self.bias


class ResidualBlock(eqx.Module):
    """Two convolutions added to what they are given, informed by the mean over the lattice and by the numbers."""

    first: Convolution
    second: Convolution
    pooled: Linear
    told: Linear

    def __init__(self, key: Key, width: int, numbers: int) -> None:
        keys = jax.random.split(key, 4)
        self.first = Convolution(keys[0], width, width)
        self.second = Convolution(keys[1], width, width, gain=0.3)
        self.pooled = Linear(keys[2], width, width, bias=False, gain=0.5)
        self.told = Linear(keys[3], numbers, width, bias=False, gain=0.5)

    def __call__(self, x: Float[Array, "h w d"], told: Float[Array, " n"]) -> Float[Array, "h w d"]:
        """x, corrected."""
        whole = self.pooled(jnp.mean(x, axis=(0, 1))) + self.told(told)
        return x + self.second(jax.nn.relu(self.first(x) + whole))


class FieldNetwork(eqx.Module):
    """Corrections of mean and deviation at the points of a lattice of any size; all weights are float32."""

    embed: Linear  # of the numbers
    stem: Convolution
    down: Convolution
    told: Linear
    blocks: tuple[ResidualBlock, ...]
    up: Linear
    mix: Convolution
    head: Linear
    maps: int = eqx.field(static=True)
    numbers: int = eqx.field(static=True)
    width: int = eqx.field(static=True)
    depth: int = eqx.field(static=True)

    def __init__(self, key: Key, *, maps: int, numbers: int, width: int = 48, depth: int = 3) -> None:
        """A new network whose corrections are all zero. Raises InputError for a size below 1 and an odd width."""
        for name, size in {"maps": maps, "numbers": numbers, "width": width, "depth": depth}.items():
            if size < 1:
                raise InputError(f"{name} is {size}; it must be at least 1")
        if width % 2:
            raise InputError(f"width is {width}; it must be even")
        keys = jax.random.split(key, 7 + depth)
        fine, told = width // 2, max(width // 2, 8)
        self.embed = Linear(keys[0], numbers, told)
        self.stem = Convolution(keys[1], maps, fine)
        self.down = Convolution(keys[2], fine, width, stride=2)
        self.told = Linear(keys[3], told, width, bias=False)
        self.blocks = tuple(ResidualBlock(each, width, told) for each in keys[7:])
        self.up = Linear(keys[4], width, fine)
        self.mix = Convolution(keys[5], 2 * fine, fine)
        self.head = Linear(keys[6], fine, 2, gain=0.0)
        self.maps, self.numbers, self.width, self.depth = maps, numbers, width, depth

    @property
    def architecture(self) -> dict[str, int]:
        """The arguments that make a network of this shape."""
        return {"maps": self.maps, "numbers": self.numbers, "width": self.width, "depth": self.depth}

    def __call__(
        self, maps: Float[Array, "h w c"], numbers: Float[Array, " n"]
    ) -> tuple[Float[Array, "h w"], Float[Array, "h w"]]:
        """What to add to the mean, in deviations, and to the logarithm of the deviation."""
        told = jax.nn.relu(self.embed(numbers.astype(jnp.float32)))
        fine = jax.nn.relu(self.stem(maps.astype(jnp.float32)))
        coarse = jax.nn.relu(self.down(fine) + self.told(told))
        for block in self.blocks:
            coarse = block(coarse, told)
        back = finer(self.up(jax.nn.relu(coarse)), (maps.shape[0], maps.shape[1]))
        answer = self.head(jax.nn.relu(self.mix(jnp.concatenate([fine, back], axis=-1))))
        return _within(answer[..., 0], _MOST_SHIFT), _within(answer[..., 1], _MOST_STRETCH)


def finer(x: Float[Array, "k l d"], shape: tuple[int, int]) -> Float[Array, "h w d"]:
    """A lattice with ends at the same places and more points on each side, linear in between."""
    rows, columns = (_stretch(few, many, x.dtype) for few, many in zip(x.shape[:2], shape, strict=True))
    return jnp.einsum("hk,kld->hld", rows, jnp.einsum("wl,kld->kwd", columns, x))


def _stretch(few: int, many: int, dtype: jnp.dtype) -> Float[Array, "many few"]:
    place = jnp.linspace(0.0, few - 1.0, many, dtype=dtype)
    return jnp.maximum(0.0, 1.0 - jnp.abs(place[:, None] - jnp.arange(few, dtype=dtype)))


def _within(x: Float[Array, "*s"], most: float) -> Float[Array, "*s"]:
    return most * jnp.tanh(x / most)
