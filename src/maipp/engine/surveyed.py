"""What missions leave when they are over: the ways of their agents, and the team's belief at any points."""

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine.mission import Mission
from maipp.engine.score import belief_of, taken_by
from maipp.engine.state import State
from maipp.errors import InputError
from maipp.kept import kept
from maipp.typing import Array, Float


def trajectories(states: State) -> list[list[Float[np.ndarray, "k 3"]]]:
    """Of each mission of a batch the way of each agent: rows of time, x and y (domain units), one per vertex."""
    route, time, length = (np.asarray(a) for a in (states.route, states.route_time, states.route_length))
    whole = np.concatenate([time[..., None], route], axis=-1)
    return [[whole[b, i, :count] for i, count in enumerate(counts)] for b, counts in enumerate(length)]


def belief_at(
    missions: Mission,
    states: State,
    points: Float[Array | np.ndarray, "p 2"],
    *,
    mission: int = 0,
    time: float = float("inf"),
) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
    """Mean and variance that all measurements taken by a time leave at any points (domain units), of one of a batch.

    Raises `InputError` for points that are not (p, 2), and for a mission that the batch does not have.
    """
    points = jnp.asarray(points, jnp.result_type(float))
    if points.ndim != 2 or points.shape[1] != 2:
        raise InputError(f"points: their shape is {points.shape}; give (p, 2)")
    if not 0 <= mission < len(states.events):
        raise InputError(f"mission: {mission} is not one of the {len(states.events)} of the batch; they count from 0")
    one, state = jax.tree.map(lambda array: array[mission], (missions, states))
    return _belief_at(one, state, points, jnp.asarray(time, points.dtype))


@kept
def _belief_at(mission: Mission, state: State, points: Array, time: Array) -> tuple[Array, Array]:
    belief = belief_of(mission, state, taken_by(state, time)).on(points)
    return belief.mean, belief.variance
