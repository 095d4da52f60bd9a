"""The way to what is worth measuring beyond a planner's horizon: out of dead ends, around peninsulas and islands."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import lax

from maipp.roadmap.shortest_paths import shortest_paths, sight, waypoints
from maipp.roadmap.zones import Zones
from maipp.typing import Array, Float, Point, Real

# Points of the evaluation grid to which ways are looked up, and of those the ones whose measurement is predicted.
_LOOKED_UP, _PREDICTED = 96, 8


class Transit(NamedTuple):
    """The way to the point whose measurement pays most for its length."""

    path: Float[Array, "w 2"]  # waypoints
    distance: Float[Array, ""]  # to the point, domain units; inf where none is in reach
    rate: Float[Array, ""]  # what a measurement there is worth, per domain unit of the way to it and one interval more


def best_transit(
    zones: Zones,
    here: Point,
    remaining: Float[Array, ""],
    interval: Real,
    worth: Float[Array, " q"],
    gain: Callable[[Float[Array, "k 1 2"]], Float[Array, " k"]],
) -> Transit:
    """The best transit within the `remaining` budget (domain units).

    `worth` says roughly what points of the grid are worth, 0 where nothing; `gain` what a measurement would bring.
    """
    offset = zones.places - here
    around = jnp.min(sight(zones.borders, here)[:, None] + zones.to_place, axis=0)
    # Whether a point is in sight is only asked of the best.
    about = jnp.where(jnp.isfinite(around), around, jnp.sqrt(jnp.sum(offset * offset, axis=-1)))
    some = lax.top_k(worth / (about + interval), min(_LOOKED_UP, len(worth)))[1]
    ways = shortest_paths(zones, here, zones.places[some], zones.to_place[:, some])
    in_reach = ways.length <= remaining
    best = lax.top_k(jnp.where(in_reach, worth[some] / (ways.length + interval), -1.0), min(_PREDICTED, len(some)))[1]
    length = ways.length[best]
    gained = gain(ways.ends[best][:, None])
    rate = jnp.where(in_reach[best] & ~jnp.isnan(gained), gained / (length + interval), -jnp.inf)
    chosen = jnp.argmax(rate)
    distance = jnp.where(in_reach[best[chosen]], length[chosen], jnp.inf)
    return Transit(waypoints(zones, ways, best[chosen]), distance, rate[chosen])
