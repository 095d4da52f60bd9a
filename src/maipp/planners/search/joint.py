"""The joint form of the receding horizon: one agent plans the next legs of the whole team."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief, extend
from maipp.engine.decision import Observation
from maipp.planners.announced.announcement import TeamPlan
from maipp.planners.search.optimiser import begin, descend
from maipp.planners.search.outlook import Ahead, Outlook
from maipp.planners.search.plan_search import PlanSearch
from maipp.planners.search.prospect import Prospect
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index, Key


class _TeamStarts(NamedTuple):
    """Where everybody starts its next free leg, as the due agent knows it."""

    base: Float[Array, "m 2"]  # there
    steps: Float[Array, "m h"]  # leg lengths
    affordable: Bool[Array, "m h"]  # legs that its budget allows
    plans: Float[Array, "m h 2"]  # its last plan, displacements in units of a leg


def plan_team(
    search: PlanSearch,
    sweeps: int,
    key: Key,
    observation: Observation,
    last: Float[Array, "h 2"],
    ahead: Ahead,
    prospect: Prospect | None = None,
) -> Float[Array, "h 2"]:
    """The due agent's legs in the best plan found for the team: displacements, in units of a leg.

    Each agent's legs are optimised in turn given the others', `sweeps` times over, then all of them together by
    gradient. Agents that are not heard are left out.
    """
    team, belief = _gather(search, observation, last, ahead)
    inside, known = observation.inside, observation.belief.variance
    agents = search.scenario.agents
    value = search.scenario.virtual_value

    def points(plans: Float[Array, "m h 2"]) -> Float[Array, "m h 2"]:
        return jax.vmap(search.walked)(team.base, plans, team.steps)

    def improve(i: Index, plans: Float[Array, "m h 2"]) -> Float[Array, "m h 2"]:
        agent = (observation.agent + i) % agents
        others = team.affordable & (jnp.arange(agents) != agent)[:, None]
        counted = extend(belief, points(plans).reshape(-1, 2), others.reshape(-1), virtual_value=value)
        where = team.base[agent], team.steps[agent], team.affordable[agent]
        outlook = Outlook(*where, counted, known, inside, prospect=prospect)
        better = search.plan(jax.random.fold_in(key, i), outlook, plans[agent])
        return plans.at[agent].set(better.best)

    plans = lax.fori_loop(0, sweeps * agents, improve, team.plans)
    index = search.objective.in_play(belief, inside, search.points, prospect=prospect)
    coarse, coarse_inside, coarse_known = belief.at(index), inside[index], known[index]
    coarse_prospect = None if prospect is None else prospect.at(index)

    def after(
        belief: Belief,
        inside: Bool[Array, " i"],
        known: Float[Array, " i"],
        prospect: Prospect | None,
        plans: Float[Array, "m h 2"],
    ) -> Float[Array, ""]:
        then = extend(belief, points(plans).reshape(-1, 2), team.affordable.reshape(-1), virtual_value=value)
        return search.objective.expected(then.mean, then.variance, known, inside, prospect)

    slope = jax.grad(lambda plans: after(coarse, coarse_inside, coarse_known, coarse_prospect, plans))
    refined = descend(slope, begin(plans), search.gradient_steps, search.rate / 2).plans
    better = after(belief, inside, known, prospect, refined) < after(belief, inside, known, prospect, plans)
    return jnp.where(better, refined, plans)[observation.agent]


def _gather(
    search: PlanSearch, observation: Observation, last: Float[Array, "h 2"], ahead: Ahead
) -> tuple[_TeamStarts, Belief]:
    """The team as the due agent knows it, and its belief with the legs under way counted as measured."""
    plans: TeamPlan = observation.messages
    agents, interval = search.scenario.agents, search.scenario.measurement_interval
    me = jnp.arange(agents) == observation.agent
    planned = jnp.isfinite(plans.legs.times[:, 0])
    travelling = (
        observation.heard
        & planned
        & (plans.legs.times[:, 0] > observation.time + DISTANCE_TOLERANCE / observation.speed)
    )
    belief = extend(
        observation.belief, plans.legs.points[:, 0], travelling, virtual_value=search.scenario.virtual_value
    )
    base = jnp.where(travelling[:, None], plans.legs.points[:, 0], observation.positions)
    base = jnp.where(me[:, None], observation.position, base)
    remaining = jnp.where(planned, plans.remaining, jnp.asarray(search.scenario.budgets))
    others_steps = jnp.full((agents, search.legs), interval)
    within = jnp.cumsum(others_steps, axis=1) <= remaining[:, None] + DISTANCE_TOLERANCE
    # An agent continues along the legs it announced, as far as they go.
    announced = jnp.diff(plans.legs.points, axis=1) / interval
    on = announced[:, -1:] if search.legs > 1 else jnp.zeros((agents, 1, 2))
    return _TeamStarts(
        base=base,
        steps=jnp.where(me[:, None], ahead.steps, others_steps),
        affordable=jnp.where(me[:, None], ahead.affordable, within & observation.heard[:, None]),
        plans=jnp.where(me[:, None, None], last, jnp.concatenate([announced, on], axis=1)),
    ), belief
