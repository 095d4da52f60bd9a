"""Announced measurements: what planners that share their next legs tell each other."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Observation
from maipp.planners.announced.announced_measurements import count_announced
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Float


class Announcement(NamedTuple):
    """Where and when an agent means to measure next."""

    points: Float[Array, "h 2"]  # positions, domain units
    times: Float[Array, " h"]  # when; inf where nothing is announced


class TeamPlan(NamedTuple):
    """What the others need in order to plan for the sender."""

    legs: Announcement  # its own next measurements
    remaining: Float[Array, ""]  # its budget when it arrives at the first of them, domain units


def nothing_announced(count: int) -> Announcement:
    """The announcement of an agent that has not planned yet."""
    return Announcement(jnp.zeros((count, 2)), jnp.full(count, jnp.inf, jnp.result_type(float)))


def nothing_planned(nothing: Announcement) -> TeamPlan:
    """The message of an agent that has not planned yet."""
    return TeamPlan(nothing, jnp.zeros(()))


def with_announced(
    observation: Observation, announced: Announcement, virtual_value: str, recall: bool = False
) -> Belief:
    """The agent's belief with the heard agents' future measurements added as virtual ones.

    `announced` has a leading axis m. Measurements whose time has passed are known for real by whoever hears them. With
    `recall` those of agents out of range count too, past ones as well: nobody has told their values yet.
    """
    future = announced.times > observation.time + DISTANCE_TOLERANCE / observation.speed
    counts = jnp.where(observation.heard[:, None], future, recall)
    valid = counts & jnp.isfinite(announced.times)
    return count_announced(
        observation.belief,
        announced.points.reshape(-1, 2),
        valid.reshape(-1),
        near=observation.position,
        virtual_value=virtual_value,
    )
