"""Random keys without a compilation of their own in every process."""

import jax
import jax.numpy as jnp
import numpy as np

from maipp.kept import kept
from maipp.seeds import check_seed
from maipp.typing import Array, Key, UInt


def key_of(seed: int) -> Key:
    """`jax.random.key(seed)`. Raises `InputError` for a seed out of range."""
    return _key(np.uint32(check_seed(seed)))


def folded(key: Key, *numbers: int) -> Key:
    """The key with each number folded in, the first one first."""
    return _folded(key, np.array(numbers, np.uint32))


@kept
def _key(seed: UInt[Array, ""]) -> Key:
    return jax.random.key(seed)


@kept
def _folded(key: Key, numbers: UInt[Array, " n"]) -> Key:
    for number in jnp.unstack(numbers):
        key = jax.random.fold_in(key, number)
    return key
