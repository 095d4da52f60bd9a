"""Which of many measurements tell most of a place: all that are near, and ever fewer of those farther away.

Measurements in farthest-point order, each as far as possible from those before it, are a picture of the survey that
gets finer as it goes on. The farther a place, the coarser a picture of it will do: with a Matern kernel what is near
screens what lies behind it. Source: Schaefer, Katzfuss, Owhadi 2021, "Sparse Cholesky factorization by
Kullback-Leibler minimization" (the ordering, and neighbours within a radius in proportion to their spacing).
"""

import jax.numpy as jnp
from jax import lax

from maipp.typing import Array, Bool, Float, Index, Int

# Measurements put in order one by one; the others count as if each came right after them. Twice as many changed no
# result below by a tenth.
_ORDERED = 1024

# Measurements are ranked by their spacing over this power of the distance. Tried: 1, 2, 3, 4, 6 and infinity (the
# nearest ones, whatever the spacing). Where measurements lie in clusters 4 and more lose the sight of what is behind.
_POWER = 3


def spacing(x: Float[Array, "n 2"], mask: Bool[Array, " n"]) -> Float[Array, " n"]:
    """Distance of each measurement from those before it in farthest-point order (domain units); 0 where masked out.

    The first has that of the farthest measurement there is.
    """
    # Masked slots may hold anything, NaN included.
    x = jnp.where(mask[:, None], lax.stop_gradient(x), 0.0)
    count = x.shape[0]
    first = jnp.argmax(mask)
    slots = jnp.arange(count)

    def to(index: Index) -> Float[Array, " n"]:
        return (x[:, 0] - x[index, 0]) ** 2 + (x[:, 1] - x[index, 1]) ** 2

    def choose(_: Index, carry: tuple[Array, Array]) -> tuple[Array, Array]:
        squared, found = carry
        farthest = jnp.max(squared)
        # Not argmax: a maximum and a minimum vectorise on a CPU, and it takes nine times as long.
        index = jnp.min(jnp.where(squared == farthest, slots, count - 1))
        return jnp.minimum(squared, to(index)), found.at[index].max(farthest)

    squared = jnp.where(mask, to(first), -1.0)
    found = jnp.full(count, -1.0, x.dtype).at[first].set(jnp.max(squared))
    squared, found = lax.fori_loop(0, min(count, _ORDERED) - 1, choose, (squared, found))
    return jnp.sqrt(jnp.where(mask, jnp.maximum(jnp.maximum(squared, found), 0.0), 0.0))


def most_telling(
    x: Float[Array, "n 2"],
    mask: Bool[Array, " n"],
    spaced: Float[Array, " n"],
    low: Float[Array, "2"],
    high: Float[Array, "2"],
    reach: float | Float[Array, ""],
    count: int,
) -> Int[Array, " c"]:
    """Indices of the `count` measurements that tell most of the box from `low` to `high`; masked ones come last.

    `spaced` is their `spacing`; `reach` (domain units, > 0) is how far around the box nearness makes no difference.
    """
    x, low, high = (lax.stop_gradient(a) for a in (x, low, high))
    # Axis by axis: a sum along a last axis of two does not vectorise on a CPU.
    across, along = (jnp.maximum(jnp.maximum(low[i] - x[:, i], x[:, i] - high[i]), 0.0) for i in (0, 1))
    distance = jnp.sqrt(across * across + along * along) + reach
    return lax.top_k(jnp.where(mask, spaced / distance**_POWER, -1.0), count)[1]
