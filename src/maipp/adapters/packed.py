"""Pytrees in one array: a compiled call takes longer over fifty small arrays than over a decision."""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from maipp.typing import Array, Int

Words = Int[Array | np.ndarray, " _"]  # of whole numbers as wide as reals: the bits of reals, then all other numbers


def word() -> np.dtype:
    """The whole numbers of packed pytrees, as wide as JAX's reals."""
    return np.dtype(f"int{8 * real().itemsize}")


def real() -> np.dtype:
    """JAX's reals."""
    return np.dtype(jnp.result_type(float))


class Packing(NamedTuple):
    """What a pytree was before it was packed; hashable."""

    kind: Any  # its tree definition
    parts: tuple[tuple[tuple[int, ...], np.dtype], ...]  # shape and type of each array

    @staticmethod
    def of(tree: Any) -> "Packing":
        """That of this pytree of arrays, or of their shapes and types."""
        leaves, kind = jax.tree.flatten(tree)
        return Packing(kind, tuple((leaf.shape, np.dtype(leaf.dtype)) for leaf in leaves))

    @property
    def size(self) -> int:
        """Words that it takes."""
        return sum(math.prod(shape) for shape, _ in self.parts)

    def pack(self, tree: Any) -> Words:
        """The arrays of the tree one after the other, those of reals first."""
        reals, others = self._apart(jax.tree.leaves(tree))
        told = [lax.bitcast_convert_type(jnp.concatenate([jnp.ravel(leaf).astype(real()) for leaf in reals]), word())]
        return jnp.concatenate(told + [jnp.ravel(leaf).astype(word()) for leaf in others])

    def pack_here(self, tree: Any) -> Words:
        """`pack` for arrays of NumPy, on the host."""
        reals, others = self._apart(jax.tree.leaves(tree))
        told = [np.concatenate([leaf.ravel() for leaf in reals], dtype=real()).view(word())]
        return np.concatenate(told + [leaf.ravel() for leaf in others], dtype=word())

    def _apart(self, leaves: list[Any]) -> tuple[list[Any], list[Any]]:
        """The arrays of reals, and the others."""
        pairs = list(zip(leaves, self.parts, strict=True))
        return [leaf for leaf, (_, kind) in pairs if kind.kind == "f"], [
            x for x, (_, kind) in pairs if kind.kind != "f"
        ]

    def unpack(self, words: Words) -> Any:
        """The tree again; on the host for words of NumPy."""
        at, leaves = [0, sum(math.prod(shape) for shape, kind in self.parts if kind.kind == "f")], []
        for shape, kind in self.parts:
            which, size = 0 if kind.kind == "f" else 1, math.prod(shape)
            part = words[at[which] : at[which] + size]
            if which == 0:
                part = part.view(real()) if isinstance(part, np.ndarray) else lax.bitcast_convert_type(part, real())
            leaves.append(part.reshape(shape).astype(kind))
            at[which] += size
        return jax.tree.unflatten(self.kind, leaves)
