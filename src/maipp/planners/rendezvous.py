"""Where a team whose radios do not reach across the area meets at the end, so that nobody's measurements are lost.

All agents know one place without a word: the middle of the area. Whoever ends within half the communication range of
it is heard by all others who do. On the way an agent may go wherever it can still be there in time.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax

from maipp.problem import ScenarioLike
from maipp.roadmap import Zones
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float

# Ways on a roadmap are this much longer than straight ones (20 neighbours of 200 nodes: some 5 %), with some reserve.
_DETOUR = 1.1


class Rendezvous(NamedTuple):
    """Where, and how near is near enough."""

    place: Float[Array, "2"]  # domain units
    radius: Float[Array, ""]  # domain units; inf where everybody always hears everybody


def rendezvous(scenario: ScenarioLike) -> Rendezvous | None:
    """The team's meeting at the end; None where no range is limited, or nobody else is there."""
    if not scenario.limited or scenario.comm_range is None or scenario.agents < 2:
        return None
    # Short of the half, so that rounding keeps nobody out.
    return Rendezvous(0.5 * jnp.asarray(scenario.extent), jnp.asarray(0.49 * scenario.comm_range))


def spare(
    meeting: Rendezvous, start: Float[Array, "2"], targets: Float[Array, "*k 2"], remaining: Float[Array, ""]
) -> Float[Array, "*k"]:
    """Budget left over, were the agent to go straight to the meeting from each target (domain units); negative: late.

    A target beyond the remaining budget is reached only in part.
    """
    leg = targets - start
    length = jnp.sqrt(jnp.sum(leg * leg, axis=-1))
    travelled = jnp.minimum(length, remaining)
    end = start + leg * (travelled / jnp.maximum(length, 1e-9))[..., None]
    away = jnp.sqrt(jnp.sum((end - meeting.place) ** 2, axis=-1))
    return remaining - travelled - _DETOUR * jnp.maximum(away - meeting.radius, 0.0)


def in_time(
    meeting: Rendezvous,
    start: Float[Array, "2"],
    targets: Float[Array, "k 2"],
    allowed: Bool[Array, " k"],
    remaining: Float[Array, ""],
) -> Bool[Array, " k"]:
    """Of the allowed targets those from which the agent makes the meeting; the one nearest to it where none does."""
    left = jnp.where(allowed, spare(meeting, start, targets, remaining), -jnp.inf)
    # An agent that cannot be there in time still hurries: others may be later, too. Compiled, the same number may round
    # differently in two places, and without a tolerance no target might be as good as the best.
    return allowed & (left >= jnp.minimum(jnp.max(left), 0.0) - DISTANCE_TOLERANCE)


def lateness(
    meeting: Rendezvous,
    start: Float[Array, "2"],
    ends: Float[Array, "*c h 2"],
    steps: Float[Array, " h"],
    remaining: Float[Array, ""],
    *,
    zones: Zones | None = None,
) -> Float[Array, "*c"]:
    """How much too late for the meeting a plan in the plane makes the agent, at the worst of its legs (domain units).

    Legs take `steps` of budget each and end at `ends`; the one on which the budget runs out is travelled in part. With
    no-go zones the way to the meeting is the one around them.
    """
    spent = jnp.cumsum(steps)
    travelled = jnp.clip(remaining - (spent - steps), 0.0, steps)
    origin = jnp.broadcast_to(start, (*ends.shape[:-2], 1, 2))
    begins = jnp.concatenate([origin, ends[..., :-1, :]], axis=-2)
    reached = begins + (ends - begins) * (travelled / jnp.maximum(steps, 1e-9))[:, None]
    if zones is None:
        squared = jnp.sum((reached - meeting.place) ** 2, axis=-1)
        away = jnp.sqrt(jnp.maximum(squared, 1e-12)) - meeting.radius
    else:
        away = _around(meeting, zones, reached) - meeting.radius
    late = jnp.maximum(jnp.maximum(away, 0.0) - jnp.maximum(remaining - spent, 0.0), 0.0)
    begun = (remaining > spent - steps) | (jnp.arange(len(steps)) == 0)
    return jnp.max(jnp.where(begun, late, 0.0), axis=-1)


def _around(meeting: Rendezvous, zones: Zones, points: Float[Array, "*c 2"]) -> Float[Array, "*c"]:
    """Length of the way from points to the meeting, between those from the points of the grid around (domain units)."""
    last = zones.to_middle.shape[0] - 1
    # The meeting is in the middle of the domain.
    place = points / (2.0 * meeting.place) * last
    low = jnp.clip(jnp.floor(lax.stop_gradient(place)), 0, last - 1)
    share, index = place - low, low.astype(jnp.int32)
    x, y = index[..., 0], index[..., 1]
    left = zones.to_middle[x, y] * (1.0 - share[..., 1]) + zones.to_middle[x, y + 1] * share[..., 1]
    right = zones.to_middle[x + 1, y] * (1.0 - share[..., 1]) + zones.to_middle[x + 1, y + 1] * share[..., 1]
    return left * (1.0 - share[..., 0]) + right * share[..., 0]
