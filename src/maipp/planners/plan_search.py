"""Search over plans given as headings: random starts, then the gradient of a smoothed Tr(P)."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.typing import Array, Float, Key

# Plans turn by this much per leg (standard deviation, radians): straighter ones look too little around, curlier ones
# measure the same place twice.
_TURN = 0.8

# Adam's decay rates. Short memories: a search takes some twenty steps.
_MOMENTUM, _SCALE = 0.7, 0.9


class SearchOptions(NamedTuple):
    """How much to search."""

    candidates: int  # random plans scored
    elites: int  # best of them that are refined
    steps: int  # gradient steps
    rate: float  # first gradient step, radians; falls to zero linearly


def random_plans(key: Key, last: Float[Array, " h"], count: int) -> Float[Array, "c h"]:
    """Headings of random plans: a quarter near the last plan, the others in any direction with random turns."""
    first_key, turn_key, near_key = jax.random.split(key, 3)
    legs = last.shape[0]
    first = jax.random.uniform(first_key, (count, 1), minval=-jnp.pi, maxval=jnp.pi)
    turns = _TURN * jax.random.normal(turn_key, (count, legs - 1))
    fresh = jnp.concatenate([first, first + jnp.cumsum(turns, axis=1)], axis=1)
    near = max(1, count // 4)
    # The first of them is the last plan itself.
    spread = jnp.linspace(0.0, 0.5, near)[:, None]
    return fresh.at[:near].set(last + spread * jax.random.normal(near_key, (near, legs)))


def descend(
    gradient: Callable[[Array], Array], start: Float[Array, "*e h"], steps: int, rate: float
) -> Float[Array, "*e h"]:
    """`start` after Adam steps (Kingma & Ba 2015) whose length falls linearly from `rate` to zero."""

    def step(i: Array, carry: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        headings, mean, square = carry
        slope = jnp.nan_to_num(gradient(headings))
        mean = _MOMENTUM * mean + (1 - _MOMENTUM) * slope
        square = _SCALE * square + (1 - _SCALE) * slope * slope
        count = i.astype(headings.dtype) + 1
        direction = (mean / (1 - _MOMENTUM**count)) / (jnp.sqrt(square / (1 - _SCALE**count)) + 1e-9)
        return headings - rate * (1 - i / steps) * direction, mean, square

    zeros = jnp.zeros_like(start)
    return lax.fori_loop(0, steps, step, (start, zeros, zeros))[0]


def search(
    key: Key,
    last: Float[Array, " h"],
    *,
    score: Callable[[Array], Array],
    smooth: Callable[[Array], Array],
    final: Callable[[Array], Array],
    options: SearchOptions,
) -> Float[Array, " h"]:
    """The best plan found, radians.

    `score` (c, h) -> (c,) ranks the random plans, the gradient of `smooth` (e, h) -> (e,) refines the best of them,
    and `final` (e, h) -> (e,) chooses among the refined and the unrefined.
    """
    plans = random_plans(key, last, options.candidates)
    _, best = lax.top_k(-score(plans), options.elites)
    elites = plans[best]
    refined = descend(jax.grad(lambda h: jnp.sum(smooth(h))), elites, options.steps, options.rate)
    finalists = jnp.concatenate([elites, refined])
    return finalists[jnp.argmin(final(finalists))]
