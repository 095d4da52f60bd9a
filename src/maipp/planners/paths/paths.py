"""Trajectories sampled from the policy: virtual steps that change the agent's place, budget and uncertainty.

Source: Yang et al. 2023, Sec. IV-B: the other agents are assumed to stay where they are.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import Belief
from maipp.engine.polyline import along_paths
from maipp.planners.announced.meeting import Rendezvous
from maipp.planners.lookahead import predicted_variance
from maipp.planners.paths.view import PolicyView, policy_view
from maipp.planners.roadmap.edges import edges
from maipp.policy import Memory, PolicyNetwork, Prepared
from maipp.problem import ScenarioLike
from maipp.roadmap import Edges, Roadmap
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index, Int, Key, Vector


class Paths(NamedTuple):
    """Trajectories of a paths with j steps each, from where the agent is."""

    choices: Int[Array, " a"]  # which neighbour each visits first
    nodes: Int[Array, "a j"]  # roadmap nodes, one after the other; the last one again where it stops early
    taken: Bool[Array, "a j"]  # False for steps that the budget does not allow
    length: Float[Array, " a"]  # domain units
    turns: Int[Array, "a j"]  # which neighbour each visits at each step; -1 for steps not taken


class AgentState(NamedTuple):
    """Where the due agent is, and what it knows: what all virtual steps start from."""

    roadmap: Roadmap
    nodes: Belief  # predicted at the roadmap's nodes
    here: Edges  # the node where the agent is, and the edges it may leave it by
    position: Float[Array, "2"]
    remaining: Float[Array, ""]  # budget left, domain units
    to_next: Float[Array, ""]  # distance to its next measurement, domain units
    intent: Vector  # the others' fused intent at the nodes
    meeting: Rendezvous | None = None  # where to be at the end


def path_measurements(scenario: ScenarioLike, situation: AgentState, paths: Paths) -> tuple[Array, Array]:
    """Where each path measures, (a, h, 2), and which of these measurements it lives to take, (a, h)."""
    return _measurements(scenario, situation, jnp.asarray(situation.roadmap.nodes)[paths.nodes], paths.length)


def _measurements(
    scenario: ScenarioLike, situation: AgentState, waypoints: Float[Array, "a j 2"], length: Float[Array, " a"]
) -> tuple[Float[Array, "a h 2"], Bool[Array, "a h"]]:
    interval = scenario.measurement_interval
    # Room for as many as edges of the usual length pass, or as many as there can ever be.
    room = math.ceil(waypoints.shape[1] * scenario.usual_edge / scenario.finest_interval) + 1
    room = min(room, scenario.measurements_per_agent)
    within = jnp.minimum(length, situation.remaining)
    # A path of longer edges passes more: then as many as there is room for stand for all, from the first to the last.
    # Leaving out the last ones would favour or spite long paths for their end alone.
    passed = jnp.floor((within - situation.to_next + DISTANCE_TOLERANCE) / interval) + 1.0
    stretch = jnp.maximum((passed - 1.0) / max(room - 1, 1), 1.0)
    offsets = situation.to_next + interval * jnp.round(stretch[:, None] * jnp.arange(room))
    points = jax.vmap(lambda path, at: along_paths(situation.position, path, at)[0])(waypoints, offsets)
    return points, offsets <= within[:, None] + DISTANCE_TOLERANCE


def virtual_views(
    scenario: ScenarioLike,
    start: AgentState,
    node: Int[Array, " a"],
    nodes: Int[Array, "a j"],
    length: Float[Array, " a"],
    *,
    features: bool = True,
) -> PolicyView:
    """What the policy is shown at `node` (leading axis a), having come by `nodes`, `length` far (domain units).

    Budget and standard deviations are as the measurements passed so far would leave them. Without `features` these are
    the real situation's, and only the neighbours are looked at anew.
    """
    positions = jnp.asarray(start.roadmap.nodes)
    points, taken = _measurements(scenario, start, positions[nodes], length)
    everywhere = predicted_variance(start.nodes, points, taken) if features else None

    def look(
        node: Index, length: Array, points: Float[Array, "h 2"], taken: Bool[Array, " h"], variance: Vector | None
    ) -> PolicyView:
        remaining = start.remaining - length
        here = edges(start.roadmap, node, remaining, scenario.last_leg, start.meeting)
        where = here, positions[node], remaining, start.intent
        if variance is not None:
            return policy_view(scenario, start.roadmap, start.nodes, *where, jnp.sqrt(variance))
        near = predicted_variance(start.nodes.at(here.target_nodes), points[None], taken[None])[0]
        shown = policy_view(scenario, start.roadmap, start.nodes, *where)
        return shown._replace(neighbour_std=jnp.sqrt(near))

    return jax.vmap(look)(node, length, points, taken, everywhere)


def follow(turn: Index, allowed: Bool[Array, " k"], otherwise: Index) -> Index:
    """The neighbour that an earlier path turned to, if there is one (not -1) and it is still allowed."""
    return jnp.where((turn >= 0) & allowed[turn], turn, otherwise)


class _VirtualStep(NamedTuple):
    """Where the a paths are."""

    node: Int[Array, " a"]
    nodes: Int[Array, "a j"]
    length: Float[Array, " a"]
    memory: Memory  # leading axis a


def sample_paths(
    scenario: ScenarioLike,
    network: PolicyNetwork,
    prepared: Prepared,
    situation: AgentState,
    choices: Int[Array, " a"],
    memory: Memory,
    key: Key,
    *,
    steps: int,
    temperature: float,
    reencode: bool,
    kept: Int[Array, " j"] | None = None,
) -> Paths:
    """Continue each path from its first choice by `steps - 1` samples of the policy.

    `memory` is the network's after it was shown the real situation. Every virtual step sees the budget and the standard
    deviation that the measurements passed so far would leave. `reencode` runs the whole network on each, as the
    paper does; otherwise the encoding made for the real situation serves all, and the decoder sees the neighbours'
    current standard deviation. `kept` turns, where given and allowed, are those of the first path.
    """
    roadmap, start = situation.roadmap, situation
    count = choices.shape[0]
    neighbours, distances = jnp.asarray(roadmap.neighbours), jnp.asarray(roadmap.distances)
    first = start.here
    go = first.allowed[choices]
    node = jnp.where(go, first.target_nodes[choices], first.node)
    state = _VirtualStep(
        node=node,
        nodes=jnp.broadcast_to(node[:, None], (count, steps)),
        length=jnp.where(go, first.lengths[choices], 0.0),
        memory=jax.tree.map(lambda a: jnp.broadcast_to(a, (count, *a.shape)), memory),
    )

    def decode(view: PolicyView, memory: Memory) -> tuple[Array, Memory]:
        ready = prepared
        if reencode:
            ready = network.prepare(network.encode(view.features, view.encoding))
        logits, _, memory = network.decode(ready, *view[2:], memory)
        return logits, memory

    def advance(state: _VirtualStep, inputs: tuple[Array, Key]) -> tuple[_VirtualStep, tuple[Array, Array]]:
        t, step_key = inputs
        view = virtual_views(scenario, start, state.node, state.nodes, state.length, features=reencode)
        # Where nothing is allowed all logits are -inf; any number will do, as the path stays where it is.
        logits, memory = jax.vmap(decode)(view, state.memory)
        go = view.allowed.any(axis=-1)
        choice = jax.random.categorical(step_key, jnp.where(go[:, None], logits, 0.0) / temperature)
        if kept is not None:
            choice = choice.at[0].set(follow(kept[t], view.allowed[0], choice[0]))
        node = jnp.where(go, neighbours[state.node, choice], state.node)
        length = state.length + jnp.where(go, distances[state.node, choice], 0.0)
        nodes = jnp.where(jnp.arange(steps) >= t, node[:, None], state.nodes)
        return _VirtualStep(node, nodes, length, memory), (go, jnp.where(go, choice, -1))

    times = jnp.arange(1, steps)
    state, (went, turns) = lax.scan(advance, state, (times, jax.random.split(key, steps - 1)))
    taken = jnp.concatenate([go[:, None], went.T], axis=1)
    turns = jnp.concatenate([jnp.where(go, choices, -1)[:, None], turns.T], axis=1).astype(jnp.int32)
    return Paths(choices, state.nodes, taken, state.length, turns)
