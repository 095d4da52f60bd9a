"""Packed pytrees come back as they were, on the host and from compiled calls."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("pettingzoo")

from maipp.adapters.packed import Packing  # noqa: E402

TREE = {
    "none": np.zeros((0, 2), np.float32),
    "numbers": np.array([[1.5, -np.inf], [np.nan, -0.0]], np.float32),
    "small": np.float32(1e-40),  # not a normal number: reals are carried as bits, which nothing rounds to zero
    "counts": np.array([-3, 2**31 - 1], np.int32),
    "truths": np.array([True, False, True]),
    "status": np.int8(-5),
}


def _same(here, there):
    assert here.dtype == there.dtype and here.shape == there.shape
    assert np.asarray(here).tobytes() == np.asarray(there).tobytes()


@pytest.mark.parametrize("packed_here", [True, False])
@pytest.mark.parametrize("unpacked_here", [True, False])
def test_a_tree_comes_back_bit_for_bit(packed_here, unpacked_here):
    packing = Packing.of(TREE)
    words = packing.pack_here(TREE) if packed_here else np.asarray(jax.jit(packing.pack)(TREE))
    assert words.shape == (packing.size,)
    back = packing.unpack(words) if unpacked_here else jax.jit(packing.unpack)(jnp.asarray(words))
    jax.tree.map(_same, TREE, back)
