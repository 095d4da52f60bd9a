"""The first leg of a plan in the plane: what an agent travels of it before it plans again."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.engine.polyline import first_part
from maipp.planners.plane.walks import within_leg
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Real


class FirstLeg(NamedTuple):
    """What an agent that has planned travels, and what it tells of its plan."""

    way: Float[Array, "2 2"]  # the bend of its first leg, and the end
    points: Float[Array, "h 2"]  # where it means to measure
    plan: Float[Array, "h 2"]  # the legs, displacements in units of a leg


def depart(
    position: Float[Array, "2"], leg: FirstLeg, steps: Float[Array, " h"], share: Real
) -> tuple[Float[Array, "2 2"], Float[Array, "h 2"]]:
    """The way of the first leg, at most `share` (domain units) of it, and what is left of the plan at its end.

    `steps` are the lengths of the legs. What is left of a plan are displacements in units of a leg: at the end of the
    first leg all but that one, before it that one too, from where the agent is then and in units of what is left of it.
    """
    plan = within_leg(leg.plan)
    short = steps[0] > share + DISTANCE_TOLERANCE
    way = jnp.where(short, first_part(position, leg.way, share), leg.way)
    rest = (leg.points[0] - way[-1]) / jnp.where(short, steps[0] - share, 1.0)
    return way, jnp.where(short, plan.at[0].set(rest), jnp.roll(plan, -1, axis=0))


def length(start: Float[Array, "2"], way: Float[Array, "w 2"]) -> Float[Array, ""]:
    """Of the way from `start` through these waypoints, domain units."""
    return jnp.sum(jnp.sqrt(jnp.sum(jnp.diff(way, axis=0, prepend=start[None]) ** 2, axis=-1)))


def either(first: Bool[Array, ""], one: FirstLeg, other: FirstLeg) -> FirstLeg:
    """One leg if `first`, else the other."""
    return FirstLeg(*(jnp.where(first, a, b) for a, b in zip(one, other, strict=True)))
