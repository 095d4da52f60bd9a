"""Pytrees in two arrays: a compiled call takes longer over fifty small arrays than over a decision."""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.typing import Array, Float, Int


class Packed(NamedTuple):
    """All numbers of a pytree."""

    reals: Float[Array | np.ndarray, " r"]
    others: Int[Array | np.ndarray, " i"]  # whole numbers and truth values, int32


class Packing(NamedTuple):
    """What a pytree was before it was packed; hashable."""

    kind: Any  # its tree definition
    parts: tuple[tuple[tuple[int, ...], np.dtype], ...]  # shape and type of each array

    @staticmethod
    def of(tree: Any) -> "Packing":
        """That of this pytree of arrays."""
        leaves, kind = jax.tree.flatten(tree)
        return Packing(kind, tuple((leaf.shape, np.dtype(leaf.dtype)) for leaf in leaves))

    def pack(self, tree: Any) -> Packed:
        """The arrays of the tree one after the other, those of reals apart."""
        real = jnp.result_type(float)
        reals: list[Array] = [jnp.zeros(0, real)]
        others: list[Array] = [jnp.zeros(0, jnp.int32)]
        for leaf, (_, kind) in zip(jax.tree.leaves(tree), self.parts, strict=True):
            floating = kind.kind == "f"
            (reals if floating else others).append(jnp.ravel(leaf).astype(real if floating else jnp.int32))
        return Packed(jnp.concatenate(reals), jnp.concatenate(others))

    def pack_here(self, tree: Any) -> Packed:
        """`pack` for arrays of NumPy, on the host; the two arrays are on the device."""
        leaves = list(zip(jax.tree.leaves(tree), self.parts, strict=True))
        reals = [leaf.ravel() for leaf, (_, kind) in leaves if kind.kind == "f"]
        others = [leaf.ravel() for leaf, (_, kind) in leaves if not kind.kind == "f"]
        real = jnp.result_type(float)
        return jax.device_put(Packed(np.concatenate(reals, dtype=real), np.concatenate(others, dtype=np.int32)))

    def unpack(self, packed: Packed) -> Any:
        """The tree again."""
        at, leaves = [0, 0], []
        for shape, kind in self.parts:
            which, size = 0 if kind.kind == "f" else 1, math.prod(shape)
            leaves.append(packed[which][at[which] : at[which] + size].reshape(shape).astype(kind))
            at[which] += size
        return jax.tree.unflatten(self.kind, leaves)
