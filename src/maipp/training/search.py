"""Learning from one's own search: of many paths sampled from the policy, the few that would leave the least Tr(P).

Making the best of many samples likelier, again and again, moves the policy to where the search of its planner wants it:
policy iteration with a search (Anthony et al. 2017), its step that of the cross-entropy method (Rubinstein 1999).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import to_rank
from maipp.engine.decision import Observation
from maipp.planners.intent import IntentPlanner
from maipp.planners.paths.path_sampler import Choice
from maipp.planners.paths.paths import virtual_views
from maipp.planners.sga_catnipp import SgaCatnipp
from maipp.policy import PolicyNetwork, Prepared
from maipp.policy.network import Memory
from maipp.training.config import TrainConfig
from maipp.typing import Array, Bool, Float, Int, Key

# The planners whose behaviour can be trained.
PolicyPlanner = IntentPlanner | SgaCatnipp


class Elites(NamedTuple):
    """The best c paths with j steps each: what the policy was shown on the way, best path first."""

    index: Int[Array, "c j"]  # the neighbour chosen
    taken: Bool[Array, "c j"]  # False for steps that the budget did not allow
    node: Int[Array, "c j"]  # where the agent stood
    neighbours: Int[Array, "c j k"]
    allowed: Bool[Array, "c j k"]
    neighbour_std: Float[Array, "c j k"]
    remaining: Float[Array, "c j"]  # longest sides of the extent


def find_elites(
    config: TrainConfig, planner: PolicyPlanner, key: Key, observation: Observation, choice: Choice
) -> Elites:
    """The `config.elites` best of `config.search_paths` paths: the planner's own, where it sampled any."""
    situation, paths, scores = choice.situation, choice.paths, choice.scores
    if paths is None or scores is None:
        paths = planner.sampler.sample(key, situation, choice.insight, paths=config.search_paths, steps=config.steps)
        scores = planner.interest.trace(
            *planner.sampler.outcomes(planner.counted(observation), situation, paths), observation.inside
        )
    _, order = lax.top_k(-to_rank(scores), config.elites)
    paths = jax.tree.map(lambda a: a[order], paths)
    # The nodes and the way that each step knew of: those it had come by so far, the last one again and again.
    count, steps = paths.nodes.shape
    start = jnp.broadcast_to(situation.here.node, (count, 1))
    stood = jnp.concatenate([start, paths.nodes[:, :-1]], axis=1)
    neighbours, distances = jnp.asarray(situation.roadmap.neighbours), jnp.asarray(situation.roadmap.distances)
    index = jnp.argmax(neighbours[stood] == paths.nodes[:, :, None], axis=-1).astype(jnp.int32)
    lengths = jnp.where(paths.taken, jnp.take_along_axis(distances[stood], index[:, :, None], axis=-1)[:, :, 0], 0.0)
    travelled = jnp.cumsum(lengths, axis=1) - lengths

    def shown(t: Array) -> tuple[Array, ...]:
        nodes = jnp.where(jnp.arange(steps) < t, paths.nodes, stood[:, t, None])
        view = virtual_views(planner.scenario, situation, stood[:, t], nodes, travelled[:, t])
        return view.neighbours, view.allowed, view.neighbour_std, view.remaining

    seen = [jnp.moveaxis(a, 0, 1) for a in jax.vmap(shown)(jnp.arange(steps))]
    return Elites(index, paths.taken, stood, *seen)


def surprise(
    network: PolicyNetwork, prepared: Prepared, memory: Memory, threshold: Float[Array, ""], elites: Elites
) -> Float[Array, ""]:
    """Minus the log-probability of a path's steps, mean over the paths; `memory` is that before the first step."""

    def path(elite: Elites) -> Float[Array, ""]:
        def step(memory: Memory, at: Elites) -> tuple[Memory, Float[Array, ""]]:
            view = (at.node, at.neighbours, at.allowed, at.neighbour_std, at.remaining)
            logits, _, memory = network.decode(prepared, *view, threshold, memory)
            logs = jax.nn.log_softmax(jnp.where(at.taken, logits, 0.0))
            return memory, jnp.where(at.taken, -logs[at.index], 0.0)

        return jnp.sum(lax.scan(step, memory, elite)[1])

    return jnp.mean(jax.vmap(path)(elites))
