"""Where an agent has to be when its budget ends: at home if it has one, else where a team out of reach meets.

A team whose radios do not reach across the area meets at the end, so that nobody's measurements are lost. All agents
know one place without a word: the middle of the area. Whoever ends within half the communication range of it is heard
by all others who do. On the way an agent may go wherever it can still be there in time. Who comes home brings its
measurements, and meets nobody.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax

from maipp.engine.decision import Observation
from maipp.problem import ScenarioLike
from maipp.roadmap import Zones
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float

# Ways on a roadmap are this much longer than straight ones (20 neighbours of 200 nodes: some 5 %), with some reserve.
_DETOUR = 1.1


class Rendezvous(NamedTuple):
    """Where, and how near is near enough."""

    places: Float[Array, "k 2"]  # any of them will do, domain units
    radius: Float[Array, ""]  # domain units; inf where it may be anywhere
    lengths: Float[Array, "g g"] | None  # of the ways there from the grid's points (x, y), around zones
    extent: Float[Array, "2"]  # of the domain
    detour: float  # how much longer than the shortest the way of an agent on a roadmap is


def rendezvous(scenario: ScenarioLike, zones: Zones | None = None) -> Rendezvous | None:
    """The team's meeting at the end; None where no range is limited, or nobody else is there."""
    if not scenario.limited or scenario.comm_range is None or scenario.agents < 2:
        return None
    extent = jnp.asarray(scenario.extent)
    lengths = None if zones is None else zones.to_middle
    # Short of the half, so that rounding keeps nobody out.
    return Rendezvous(0.5 * extent[None], jnp.asarray(0.49 * scenario.comm_range), lengths, extent, _DETOUR)


def appointment(
    scenario: ScenarioLike, observation: Observation, *, meet: bool, zones: Zones | None = None
) -> Rendezvous | None:
    """Where the due agent has to be at the end; None: anywhere. Without `meet` it meets nobody, but comes home."""
    if observation.home is None:
        return rendezvous(scenario, zones) if meet else None
    ends = observation.home.ends
    # The engine leads it home in the plane, whatever it moves on.
    radius = jnp.where(ends.bound, 0.0, jnp.inf)
    return Rendezvous(ends.places, radius, ends.lengths, jnp.asarray(scenario.extent), 1.0)


def too_far(meeting: Rendezvous, points: Float[Array, "*c 2"]) -> Float[Array, "*c"]:
    """How far from near enough points are, around the zones if the meeting knows any; negative: near enough."""
    if meeting.lengths is not None:
        return _around(meeting, points) - meeting.radius
    squared = jnp.min(jnp.sum((points[..., None, :] - meeting.places) ** 2, axis=-1), axis=-1)
    return jnp.sqrt(jnp.maximum(squared, 1e-12)) - meeting.radius


def spare(
    meeting: Rendezvous, start: Float[Array, "2"], targets: Float[Array, "*k 2"], remaining: Float[Array, ""]
) -> Float[Array, "*k"]:
    """Budget left over, were the agent to go to the meeting from each target (domain units); negative: late.

    A target beyond the remaining budget is reached only in part.
    """
    leg = targets - start
    length = jnp.sqrt(jnp.sum(leg * leg, axis=-1))
    travelled = jnp.minimum(length, remaining)
    end = start + leg * (travelled / jnp.maximum(length, 1e-9))[..., None]
    return remaining - travelled - meeting.detour * jnp.maximum(too_far(meeting, end), 0.0)


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
) -> Float[Array, "*c"]:
    """How much too late for the meeting a plan in the plane makes the agent, at the worst of its legs (domain units).

    Legs take `steps` of budget each and end at `ends`; the one on which the budget runs out is travelled in part.
    """
    spent = jnp.cumsum(steps)
    travelled = jnp.clip(remaining - (spent - steps), 0.0, steps)
    origin = jnp.broadcast_to(start, (*ends.shape[:-2], 1, 2))
    begins = jnp.concatenate([origin, ends[..., :-1, :]], axis=-2)
    reached = begins + (ends - begins) * (travelled / jnp.maximum(steps, 1e-9))[:, None]
    away = too_far(meeting, reached)
    late = jnp.maximum(jnp.maximum(away, 0.0) - jnp.maximum(remaining - spent, 0.0), 0.0)
    begun = (remaining > spent - steps) | (jnp.arange(len(steps)) == 0)
    return jnp.max(jnp.where(begun, late, 0.0), axis=-1)


def _around(meeting: Rendezvous, points: Float[Array, "*c 2"]) -> Float[Array, "*c"]:
    """Length of the way from points to the meeting, between those from the points of the grid around (domain units)."""
    lengths = meeting.lengths
    assert lengths is not None
    last = lengths.shape[0] - 1
    place = points / meeting.extent * last
    low = jnp.clip(jnp.floor(lax.stop_gradient(place)), 0, last - 1)
    share, index = place - low, low.astype(jnp.int32)
    x, y = index[..., 0], index[..., 1]
    left = lengths[x, y] * (1.0 - share[..., 1]) + lengths[x, y + 1] * share[..., 1]
    right = lengths[x + 1, y] * (1.0 - share[..., 1]) + lengths[x + 1, y + 1] * share[..., 1]
    return left * (1.0 - share[..., 0]) + right * share[..., 0]
