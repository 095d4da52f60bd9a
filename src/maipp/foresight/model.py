"""What the learned foresight knows: its network, and enough of what it was trained on to tell a stranger."""

import equinox as eqx
import jax.numpy as jnp

from maipp.foresight.features import MAPS, NUMBERS
from maipp.foresight.network import FieldNetwork
from maipp.typing import Array, Bool, Float, Int, Key

# Upper ends of the groups of measurement counts in which it was calibrated and in which it knows its inputs.
COUNTS = (0, 3, 8, 15, 24, 36, 60)

# Points per side of the network's lattice, whatever the evaluation grid.
CELLS = 15

GROUPS = len(COUNTS) + 1


class FieldModel(eqx.Module):
    """The network with its calibration and its range; a pytree of arrays, all of which are kept with the weights."""

    network: FieldNetwork
    low: Float[Array, "k g"]  # of the numbers the network is told, by measurement counts: what it was trained on
    high: Float[Array, "k g"]
    widening: Float[Array, " k"]  # factor of its deviations, by measurement counts

    def __init__(self, key: Key, *, width: int = 48, depth: int = 3) -> None:
        """A new model that corrects nothing, and takes all it meets for known."""
        self.network = FieldNetwork(key, maps=len(MAPS), numbers=len(NUMBERS), width=width, depth=depth)
        self.low = jnp.full((GROUPS, len(NUMBERS)), -jnp.finfo(jnp.float32).max, jnp.float32)
        self.high = -self.low
        self.widening = jnp.ones(GROUPS, jnp.float32)

    @property
    def architecture(self) -> dict[str, int]:
        """The arguments that make a model of this shape."""
        return {"width": self.network.width, "depth": self.network.depth}

    def knows(self, numbers: Float[Array, " g"], count: Int[Array, ""]) -> Bool[Array, ""]:
        """Whether it was trained on anything of the kind. NaN is nothing it knows."""
        group = group_of(count)
        return jnp.all((numbers >= self.low[group]) & (numbers <= self.high[group]))


def group_of(count: Int[Array, "*b"]) -> Int[Array, "*b"]:
    """The group of a number of measurements."""
    return jnp.searchsorted(jnp.asarray(COUNTS), count, side="left")
