"""What others told of their plans, counted as measured: as much of it as can matter where the agent is."""

import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, extend
from maipp.typing import Array, Bool, Float, Point

# Virtual measurements that are counted, the nearest ones. Each is one more row for every place that a planner tries,
# and far ones change all plans' values alike. Ten agents with four announcements each are all counted.
MOST_COUNTED = 64


def count_told(
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
