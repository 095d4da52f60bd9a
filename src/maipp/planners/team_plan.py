"""The joint form of the receding horizon: one agent plans the next legs of the whole team."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, extend
from maipp.planners.announced import Announcement
from maipp.planners.headings import walk
from maipp.planners.leg_planner import LegPlanner
from maipp.planners.plan_search import descend
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.simulator.decision import Observation
from maipp.typing import Array, Bool, Float, Index, Key


class TeamPlan(NamedTuple):
    """What the others need in order to plan for the sender."""

    legs: Announcement  # its own next measurements
    remaining: Float[Array, ""]  # its budget when it arrives at the first of them, domain units


def nothing_planned(nothing: Announcement) -> TeamPlan:
    """The message of an agent that has not planned yet."""
    return TeamPlan(nothing, jnp.zeros(()))


class _Team(NamedTuple):
    """Where everybody starts its next free leg, as the due agent knows it."""

    base: Float[Array, "m 2"]  # there
    steps: Float[Array, "m h"]  # leg lengths
    affordable: Bool[Array, "m h"]  # legs that its budget allows
    headings: Float[Array, "m h"]  # its last plan


def plan_team(
    planner: LegPlanner,
    sweeps: int,
    key: Key,
    observation: Observation,
    last: Float[Array, " h"],
    steps: Float[Array, " h"],
    affordable: Bool[Array, " h"],
) -> Float[Array, " h"]:
    """Headings of the due agent's legs in the best plan found for the team.

    Each agent's legs are optimised in turn given the others', `sweeps` times over, then all of them together by
    gradient. Agents that are not heard are left out.
    """
    team, belief = _gather(planner, observation, last, steps, affordable)
    inside = observation.inside
    agents = planner.scenario.agents
    value = planner.scenario.virtual_value

    def points(headings: Float[Array, "m h"]) -> Float[Array, "m h 2"]:
        return jax.vmap(lambda p, h, s: walk(p, h, s, planner.scenario.extent))(team.base, headings, team.steps)

    def improve(i: Index, headings: Float[Array, "m h"]) -> Float[Array, "m h"]:
        agent = (observation.agent + i) % agents
        others = team.affordable & (jnp.arange(agents) != agent)[:, None]
        known = extend(belief, points(headings).reshape(-1, 2), others.reshape(-1), virtual_value=value)
        better = planner.plan_legs(
            jax.random.fold_in(key, i),
            known,
            inside,
            team.base[agent],
            headings[agent],
            team.steps[agent],
            team.affordable[agent],
        )
        return headings.at[agent].set(better)

    headings = lax.fori_loop(0, sweeps * agents, improve, team.headings)
    index = planner.coarse_points()
    coarse, coarse_inside = belief.at(index), inside[index]

    def after(belief: Belief, headings: Float[Array, "m h"]) -> Belief:
        return extend(belief, points(headings).reshape(-1, 2), team.affordable.reshape(-1), virtual_value=value)

    def smooth(headings: Float[Array, "m h"]) -> Float[Array, ""]:
        then = after(coarse, headings)
        return planner.interest.soft_trace(then.mean, then.variance, coarse_inside, planner.temperature)

    def exact(headings: Float[Array, "m h"]) -> Float[Array, ""]:
        then = after(belief, headings)
        return planner.interest.trace(then.mean, then.variance, inside)

    refined = descend(jax.grad(smooth), headings, planner.steps, planner.rate / 2)
    best = jnp.where(exact(refined) < exact(headings), refined, headings)
    return best[observation.agent]


def _gather(
    planner: LegPlanner,
    observation: Observation,
    last: Float[Array, " h"],
    steps: Float[Array, " h"],
    affordable: Bool[Array, " h"],
) -> tuple[_Team, Belief]:
    """The team as the due agent knows it, and its belief with the legs under way counted as measured."""
    plans: TeamPlan = observation.messages
    agents, interval = planner.scenario.agents, planner.scenario.measurement_interval
    me = jnp.arange(agents) == observation.agent
    planned = jnp.isfinite(plans.legs.times[:, 0])
    travelling = (
        observation.heard
        & planned
        & (plans.legs.times[:, 0] > observation.time + DISTANCE_TOLERANCE / observation.speed)
    )
    belief = extend(
        observation.belief, plans.legs.points[:, 0], travelling, virtual_value=planner.scenario.virtual_value
    )
    base = jnp.where(travelling[:, None], plans.legs.points[:, 0], observation.positions)
    base = jnp.where(me[:, None], observation.position, base)
    remaining = jnp.where(planned, plans.remaining, jnp.asarray(planner.scenario.budgets))
    others_steps = jnp.full((agents, planner.horizon), interval)
    within = jnp.cumsum(others_steps, axis=1) <= remaining[:, None] + DISTANCE_TOLERANCE
    # An agent continues along the legs it announced, as far as they go.
    turns = jnp.diff(plans.legs.points, axis=1)
    announced = jnp.arctan2(turns[..., 1], turns[..., 0])
    announced = jnp.concatenate([announced, announced[:, -1:]], axis=1) if planner.horizon > 1 else announced
    announced = announced if planner.horizon > 1 else jnp.zeros((agents, 1))
    return _Team(
        base=base,
        steps=jnp.where(me[:, None], steps, others_steps),
        affordable=jnp.where(me[:, None], affordable, within & observation.heard[:, None]),
        headings=jnp.where(me[:, None], last, announced),
    ), belief
