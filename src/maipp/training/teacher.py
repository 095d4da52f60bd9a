"""The teacher that a new policy imitates: the receding-horizon plan, read off on the roadmap."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Observation
from maipp.engine.polyline import along_paths
from maipp.planners.lookahead import measurement_offsets
from maipp.planners.paths.view import PolicyView
from maipp.planners.plane.walks import walk
from maipp.planners.search.outlook import Outlook
from maipp.planners.search.plan_search import PlanSearch
from maipp.problem import ScenarioLike
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Float, Key

# How much farther from the plan a node may lie for each unit that it lies farther ahead: measured on 48 worlds of
# seed 7, an agent that always goes to the best node ends at Tr(P) 25.7, 15.4, 14.0, 15.4 for 0, 0.3, 0.6, 1 (B = 2).
_FAR = 0.6

# Width of the soft choice among nodes near the plan, domain units.
_SOFTNESS = 0.02

# Plans this much worse than the best, relative to its value, have 1/e of its say.
_TOLERANCE = 0.08

# Legs planned ahead, one measurement each, the trust in the spread of what they will measure, and
# the smoothing of the area's border: those of the teacher that the shipped weights had.
_HORIZON, _SPREAD, _BLUR = 4, 0.3, 0.02


class Lesson(NamedTuple):
    """What the teacher would do."""

    choice: Float[Array, " k"]  # distribution over the neighbours; all zero where none is allowed
    plan: Float[Array, " h"]  # headings, to start the agent's next plan from


def no_plan() -> Float[Array, " h"]:
    """What the teacher remembers of an agent that has not moved yet."""
    return jnp.zeros(_HORIZON)


def teach(
    scenario: ScenarioLike,
    key: Key,
    observation: Observation,
    belief: Belief,
    view: PolicyView,
    plan: Float[Array, " h"],
) -> Lesson:
    """The choices that follow the best plans in the plane found for the due agent; `belief` counts the others' intents.

    Whoever goes to node v has travelled d(v): the better a node, the nearer it is to the point that far along a plan.
    Several plans are often all but equally good, and which one is best is an accident of the search: each has a say by
    its value, which spares the policy most of the noise of a single one.
    """
    search = PlanSearch(scenario, horizon=_HORIZON, spread=_SPREAD, blur=_BLUR)
    interval = scenario.measurement_interval
    offsets = measurement_offsets(observation.to_next_measurement, interval, _HORIZON)
    legs = jnp.diff(offsets, prepend=0.0)
    affordable = offsets <= observation.remaining + DISTANCE_TOLERANCE
    where, known = observation.position, observation.belief.variance
    found = search.plan(key, Outlook(where, legs, affordable, belief, known, observation.inside), plan)
    assert observation.roadmap is not None
    targets = jnp.asarray(observation.roadmap.nodes)[view.neighbours]
    lengths = jnp.asarray(observation.roadmap.distances)[view.node]
    some = view.allowed.any()

    def follow(headings: Float[Array, " h"]) -> Float[Array, " k"]:
        ideal, _ = along_paths(where, walk(where, headings, legs, scenario.extent), lengths)
        miss = jnp.sqrt(jnp.sum((ideal - targets) ** 2, axis=-1)) - _FAR * lengths
        return jax.nn.softmax(jnp.where(some, jnp.where(view.allowed, -miss / _SOFTNESS, -jnp.inf), 0.0))

    say = jax.nn.softmax(-jnp.log(jnp.maximum(found.values, 1e-6)) / _TOLERANCE)
    choice = jnp.where(some, say @ jax.vmap(follow)(found.plans), 0.0)
    # A plan moves on by a leg whenever the agent measures; it is only where the next search begins.
    crossed = jnp.sum(choice * lengths) > legs[0]
    return Lesson(choice, jnp.where(crossed, jnp.roll(found.best, -1), found.best))
