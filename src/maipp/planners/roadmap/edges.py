"""The edges that the due agent may take on its roadmap, and the way out of dead ends among no-go zones."""

import jax.numpy as jnp
from jax import lax

from maipp.engine.decision import Observation
from maipp.planners.announced.meeting import Rendezvous, in_time
from maipp.planners.roadmap.path_lengths import lengths_from, lengths_to
from maipp.problem import ScenarioLike
from maipp.renamed import renamed
from maipp.roadmap import Edges, Roadmap, edges_from, nearest_node
from maipp.typing import Array, Bool, Float, Index

# All in measurement intervals. Nodes nearer than the first are passed over where there are others.
_APART = 0.1
# An agent stays around a place if so many of so many last measurements lie within this distance of the very last.
_MANY, _LAST, _AROUND = 3, 8, 0.95
# A node farther than this from all measurements is unmeasured.
_UNMEASURED = 1.25


def roadmap_of(observation: Observation) -> Roadmap:
    """The due agent's roadmap. Raises ValueError where the mission was drawn without roadmaps."""
    if observation.roadmap is None:
        raise ValueError("this planner moves on a roadmap: draw the missions with roadmaps=True")
    return observation.roadmap


def edges(
    roadmap: Roadmap,
    node: Index,
    remaining: Float[Array, ""],
    last_leg: str = "stop",
    meeting: Rendezvous | None = None,
) -> Edges:
    """The edges that the budget allows, see `edges_from`; with a `meeting` only those that leave time for it."""
    here = edges_from(roadmap, node, remaining, last_leg)
    if meeting is None:
        return here
    start = jnp.asarray(roadmap.nodes)[node]
    return here._replace(allowed=in_time(meeting, start, here.targets, here.allowed, remaining))


def feasible_edges(scenario: ScenarioLike, observation: Observation, meeting: Rendezvous | None = None) -> Edges:
    """The edges the due agent may take; see `edges`.

    Among no-go zones, an agent that stays around a place has but one: the first of the shortest way to the
    nearest unmeasured node that its budget reaches, if there is any. All neighbours of a node in a bay may be in
    that bay, and whatever chooses among them would never leave it. Raises ValueError where the mission was drawn
    without roadmaps.
    """
    roadmap = roadmap_of(observation)
    node = nearest_node(roadmap, observation.position)
    here = edges(roadmap, node, observation.remaining, scenario.last_leg, meeting)
    return here._replace(allowed=_leading_on(scenario, observation, here)) if scenario.has_zones else here


def _leading_on(scenario: ScenarioLike, observation: Observation, here: Edges) -> Bool[Array, " k"]:
    """Of the allowed edges, those that lead on."""
    roadmap, interval = roadmap_of(observation), scenario.measurement_interval
    # To and fro between two nodes that all but coincide would fill the agent's record before it gets anywhere.
    apart = here.allowed & (here.lengths > _APART * interval)
    allowed = jnp.where(apart.any(), apart, here.allowed)

    x, known = observation.measurement_x, observation.known
    mine = known & (observation.measured_by == observation.agent)
    times = jnp.where(mine, observation.measurement_time, -jnp.inf)
    latest, index = lax.top_k(times, min(_LAST, len(times)))
    near = jnp.sum((x[index] - x[index[0]]) ** 2, axis=-1) < (_AROUND * interval) ** 2
    stays = jnp.sum(near & jnp.isfinite(latest)) >= _MANY

    nodes = jnp.asarray(roadmap.nodes)
    squares = jnp.sum((nodes[:, None] - x) ** 2, axis=-1)
    unmeasured = jnp.all((squares > (_UNMEASURED * interval) ** 2) | ~known, axis=1)
    length = lengths_from(roadmap, here.node)
    goal_length = jnp.where(unmeasured & (length <= observation.remaining), length, jnp.inf)
    onward = here.lengths + lengths_to(roadmap, jnp.argmin(goal_length))[here.target_nodes]
    onward = jnp.where(allowed, onward, jnp.inf)
    lead = stays & jnp.isfinite(jnp.min(goal_length)) & jnp.isfinite(onward).any()
    return jnp.where(lead, jnp.arange(allowed.shape[0]) == jnp.argmin(onward), allowed)


renamed(__name__, edges_here="feasible_edges")
