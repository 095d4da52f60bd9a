"""The way home is kept affordable: a leg that goes too far is left for the shortest way home."""

import jax.numpy as jnp
import numpy as np

from maipp.engine.polyline import along, distances, without_repeats
from maipp.kept import kept
from maipp.roadmap.home import Home, lengths_home, path_home
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Point, Real

# Pieces that a leg is cut into, again and again, to find where it has to be left: to 1/4096 of its length.
_PIECES, _ROUNDS = 8, 4

# An agent that could follow its leg only this part of a measurement interval turns for home at once.
_SLIVER = 0.1


def led_home(
    home: Home,
    leg: Float[Array, "v 2"],
    length: Float[Array, ""],
    remaining: Float[Array, ""],
    interval: Real,
    follows: Bool[Array, ""],
) -> tuple[Float[Array, "u 2"], Bool[Array, ""]]:
    """The leg of one agent with room for the way home after it, and whether it takes that.

    It follows the whole leg if home is in reach from the end of it, else only so far that home still is, and no part of
    it where it does not follow. `remaining` is what of its budget it may spend, domain units.
    """
    share = jnp.where(follows, _affordable(home, leg, length, remaining), 0.0)
    share = jnp.where((share < length) & (share < _SLIVER * interval), 0.0, share)
    turns = home.ends.bound & (~follows | (share < length))
    share = jnp.where(home.ends.bound, share, jnp.where(follows, length, 0.0))
    last = along(leg, share)
    followed = along(leg, jnp.minimum(distances(leg), share))
    way = jnp.where(turns, path_home(home, last), last)
    return jnp.concatenate([followed, way]), turns


@kept
def _first_part_home(home: Home, here: Point) -> tuple[Float[Array, "w 2"], Float[Array, ""]]:
    return path_home(home, here), lengths_home(home, here[None])[0]


def full_path_home(home: Home, here: Float[np.ndarray, "2"]) -> tuple[Float[np.ndarray, "v 2"], float]:
    """The shortest way to one agent's home from where it is, on the host, and its length; inf: zones are between."""
    points, real = [np.asarray(here, float)], home.ends.places.dtype
    first, length = _first_part_home(home, jnp.asarray(here, real))
    while True:
        points += [np.asarray(point, float) for point in first]
        if (np.asarray(home.ends.places) == np.asarray(first[-1])).all(axis=-1).any():
            return without_repeats(np.array(points)), float(length)
        first, _ = _first_part_home(home, first[-1])


def _affordable(
    home: Home, leg: Float[Array, "v 2"], length: Float[Array, ""], remaining: Float[Array, ""]
) -> Float[Array, ""]:
    """How far along the leg the last place is from which home is in reach; its length if its end is one."""
    low, high, pieces = jnp.zeros_like(length), length, jnp.arange(1, _PIECES + 1) / _PIECES
    for _ in range(_ROUNDS):
        places = low + (high - low) * pieces
        spent = places + lengths_home(home, along(leg, places))
        last = jnp.max(jnp.where(spent <= remaining, jnp.arange(1, _PIECES + 1), 0))
        step = (high - low) / _PIECES
        low, high = low + last * step, jnp.minimum(low + (last + 1) * step, high)
    return jnp.where(low >= length - DISTANCE_TOLERANCE, length, low)
