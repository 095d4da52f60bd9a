"""Search over plans: random starts, then the gradient of a smooth objective."""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import to_rank
from maipp.typing import Array, Float, Key

T = TypeVar("T")

# Plans turn by this much per leg (standard deviation, radians): straighter ones look too little around, curlier ones
# measure the same place twice.
_TURN = 0.8

# Shortest random leg that may bend, in units of the leg: half of them are straight.
_SHORTEST = 0.3

# Adam's decay rates. Short memories: a search takes some twenty steps.
_MOMENTUM, _SCALE = 0.7, 0.9


class SearchOptions(NamedTuple):
    """How much to search."""

    candidates: int  # random plans scored
    elites: int  # best of them that are refined
    steps: int  # gradient steps
    rate: float  # first gradient step, radians or units of a leg; falls to zero linearly
    survivors: int  # best of the elites after half of the steps, which alone take the others


def random_plans(key: Key, last: Float[Array, " h *d"], count: int) -> Float[Array, "c h *d"]:
    """Random plans: a quarter near the last plan, the others in any direction with random turns.

    Plans are headings (h,), radians, or displacements (h, 2), units of a leg, whichever `last` is.
    """
    first_key, turn_key, near_key, stretch_key = jax.random.split(key, 4)
    legs = last.shape[0]
    first = jax.random.uniform(first_key, (count, 1), minval=-jnp.pi, maxval=jnp.pi)
    turns = _TURN * jax.random.normal(turn_key, (count, legs - 1))
    fresh = jnp.concatenate([first, first + jnp.cumsum(turns, axis=1)], axis=1)
    if last.ndim == 2:
        stretch = jax.random.uniform(stretch_key, (count, legs), minval=_SHORTEST, maxval=2.0 - _SHORTEST)
        fresh = jnp.minimum(stretch, 1.0)[..., None] * jnp.stack([jnp.cos(fresh), jnp.sin(fresh)], axis=-1)
    near = max(1, count // 4)
    # The first of them is the last plan itself.
    spread = jnp.linspace(0.0, 0.5, near).reshape(-1, *[1] * last.ndim)
    return fresh.at[:near].set(last + spread * jax.random.normal(near_key, (near, *last.shape)))


class Descent(NamedTuple):
    """Where a descent stands, with Adam's averages."""

    plans: Float[Array, "*e"]
    mean: Float[Array, "*e"]  # of the slope
    square: Float[Array, "*e"]  # of its square


def begin(plans: Float[Array, "*e"]) -> Descent:
    """A descent before its first step."""
    return Descent(plans, jnp.zeros_like(plans), jnp.zeros_like(plans))


def descend(
    gradient: Callable[[Array], Array], start: Descent, steps: int, rate: float, first: int = 0, last: int | None = None
) -> Descent:
    """After Adam steps `first` to `last` (Kingma & Ba 2015) of `steps`, shrinking from `rate` to 0."""

    def step(i: Array, at: Descent) -> Descent:
        slope = jnp.nan_to_num(gradient(at.plans))
        mean = _MOMENTUM * at.mean + (1 - _MOMENTUM) * slope
        square = _SCALE * at.square + (1 - _SCALE) * slope * slope
        count = i.astype(slope.dtype) + 1
        direction = (mean / (1 - _MOMENTUM**count)) / (jnp.sqrt(square / (1 - _SCALE**count)) + 1e-9)
        return Descent(at.plans - rate * (1 - i / steps) * direction, mean, square)

    return lax.fori_loop(first, steps if last is None else last, step, start)


class Finalists(NamedTuple):
    """The plans left at the end of a search."""

    plans: Float[Array, "f h *d"]
    values: Float[Array, " f"]  # of each: lower is better

    @property
    def best(self) -> Float[Array, " h *d"]:
        """The best of them."""
        return self.plans[jnp.argmin(to_rank(self.values))]


def search(
    key: Key,
    last: Float[Array, " h *d"],
    *,
    score: Callable[[Array], Array],
    final: Callable[[Array], Array],
    rough: Callable[[Array], Array] | None = None,
    options: SearchOptions,
    proposals: Float[Array, "p h *d"] | None = None,
) -> Finalists:
    """Good plans, in the form of `last`, the plan to begin from.

    `score` (c, h, *d) -> (c,) ranks plans, its gradient refines the best of them, and `final`, of the same shape,
    values the refined and the unrefined. `rough`, a cheaper score, takes its place while there are many: among the
    random plans, and in the first half of the steps. `proposals` compete with the random plans.
    """
    plans = random_plans(key, last, options.candidates)
    if proposals is not None:
        plans = jnp.concatenate([plans, proposals])
    rough = score if rough is None else rough
    elites = _best(rough, plans, plans, options.elites)
    # Steps would be spent on plans that end worse than others: after a quarter of them the better half goes on, after
    # half of them the survivors.
    half, quarter = options.steps // 2, options.steps // 4
    descent = descend(_slope(rough), begin(elites), options.steps, options.rate, last=quarter)
    survivors = min(options.survivors, options.elites)
    descent, elites = _best(rough, descent.plans, (descent, elites), max(options.elites // 2, survivors))
    descent = descend(_slope(rough), descent, options.steps, options.rate, first=quarter, last=half)
    descent, elites = _best(score, descent.plans, (descent, elites), survivors)
    descent = descend(_slope(score), descent, options.steps, options.rate, first=half)
    finalists = jnp.concatenate([elites, descent.plans])
    return Finalists(finalists, final(finalists))


def _slope(score: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """The gradient of every plan's score."""
    return jax.grad(lambda plans: jnp.sum(score(plans)))


def _best(score: Callable[[Array], Array], plans: Float[Array, "c h *d"], rows: T, count: int) -> T:
    """The rows of the best plans, best first."""
    _, best = lax.top_k(-to_rank(score(plans)), count)
    return jax.tree.map(lambda array: array[best], rows)
