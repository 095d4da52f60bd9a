"""Rows of per-agent arrays, read and written by mask."""

import jax.numpy as jnp

from maipp.typing import Array, Bool, Index


def pick(array: Array, index: Index) -> Array:
    """Row `index`, by mask: on a CPU a vmapped gather of small rows costs more than reading them all."""
    hot = (jnp.arange(array.shape[0]) == index).reshape(-1, *[1] * (array.ndim - 1))
    if array.dtype == jnp.bool_:
        return jnp.any(hot & array, axis=0)
    return jnp.sum(jnp.where(hot, array, 0), axis=0, dtype=array.dtype)


def put(array: Array, index: Index, row: Array, when: Bool[Array, ""]) -> Array:
    """`array` with row `index` replaced where `when`."""
    hot = (jnp.arange(array.shape[0]) == index).reshape(-1, *[1] * (array.ndim - 1))
    return jnp.where(hot & when, row, array)
