"""What others told of their plans, counted as measured: as much of it as can matter where the agent is."""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, extend
from maipp.engine.decision import Observation
from maipp.typing import Array, Bool, Float, Point

# Virtual measurements that are counted, the nearest ones. Each is one more row for every place that a planner tries,
# and far ones change all plans' values alike. Ten agents with four announcements each are all counted.
MOST_COUNTED = 64

Message = TypeVar("Message")  # a pytree


def count_announced(
    belief: Belief, points: Float[Array, "p 2"], told: Bool[Array, " p"], *, near: Point | None, virtual_value: str
) -> Belief:
    """The belief with the told points as virtual measurements; of more than `MOST_COUNTED` those nearest to `near`.

    Without `near` all of them.
    """
    if near is not None and points.shape[0] > MOST_COUNTED:
        offset = points - near
        squared = jnp.where(told, jnp.sum(offset * offset, axis=-1), jnp.inf)
        index = lax.top_k(-lax.stop_gradient(squared), MOST_COUNTED)[1]
        points, told = points[index], told[index]
    return extend(belief, points, told, virtual_value=virtual_value)


def count_targets(observation: Observation, virtual_value: str) -> Belief:
    """The due agent's belief with the places counted as measured that the others heard announce they head to.

    Messages are positions (m, 2), NaN of whoever heads nowhere.
    """
    told = observation.heard & jnp.isfinite(observation.messages).all(axis=-1)
    targets = jnp.where(told[:, None], observation.messages, 0.0)
    return count_announced(observation.belief, targets, told, near=observation.position, virtual_value=virtual_value)


def no_target() -> Float[Array, "2"]:
    """The message of an agent that heads nowhere."""
    return jnp.full(2, jnp.nan, jnp.result_type(float))


def latest(heard: Bool[Array, " m"], new: Message, old: Message) -> Message:
    """The new messages of the agents heard, the old ones of the others; leading axis m."""
    return jax.tree.map(lambda n, o: jnp.where(heard.reshape(-1, *[1] * (n.ndim - 1)), n, o), new, old)
