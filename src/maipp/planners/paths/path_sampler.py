"""The policy on a roadmap: what the network is shown, what it chooses, and the paths sampled from it."""

import warnings
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Observation
from maipp.engine.options import option
from maipp.errors import InputError
from maipp.planners.announced.meeting import appointment
from maipp.planners.lookahead import predicted
from maipp.planners.paths.paths import AgentState, Paths, follow, path_measurements, sample_paths
from maipp.planners.paths.view import PolicyView, policy_view
from maipp.planners.roadmap.edges import feasible_edges, roadmap_of
from maipp.policy import Memory, PolicyNetwork, Prepared, network_named
from maipp.problem import Problem
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Index, Int, Key, Vector


class Insight(NamedTuple):
    """What the network makes of a situation."""

    view: PolicyView
    prepared: Prepared
    logits: Float[Array, " k"]
    value: Float[Array, ""]
    memory: Memory  # after the situation

    @property
    def stuck(self) -> Bool[Array, ""]:
        """Whether there is no neighbour to go to."""
        return ~self.view.allowed.any()


class Choice(NamedTuple):
    """A decision as a trainer needs it."""

    situation: AgentState  # where the agent was
    insight: Insight  # what the network made of it
    memory: Memory  # of the network before the decision
    index: Index  # the neighbour chosen
    paths: Paths | None = None  # those it ranked, if any
    scores: Float[Array, " a"] | None = None  # what each would leave

    @property
    def view(self) -> PolicyView:
        """What the network was shown."""
        return self.insight.view

    @property
    def log_probability(self) -> Float[Array, ""]:
        """Of the choice, at temperature 1."""
        return log_probability(self.insight.logits, self.index)


class PathSampler(eqx.Module):
    """A policy network, asked about a roadmap."""

    scenario: Scenario | Problem
    weights: str = option("ti", meaning="shipped weights, a .safetensors file, or untrained")
    temperature: float = option(1.0, meaning="of the softmax that steps are sampled from")
    meet: bool = option(True, meaning="with limited communication: end where the others end")
    network: PolicyNetwork | None = None  # the network itself, from Python; None: as `weights` says

    def __post_init__(self) -> None:
        if self.network is None:
            self.network = network_named(self.weights)

    def check(self) -> None:
        """Raise InputError for options out of range."""
        if not self.temperature > 0:
            raise InputError(f"temperature={self.temperature}: give a number > 0")

    @property
    def policy(self) -> PolicyNetwork:
        """The network."""
        assert self.network is not None  # __post_init__ has seen to it
        return self.network

    @property
    def encoding_dimensions(self) -> int:
        """As many columns as the network was made for."""
        return self.policy.encoding_dimensions

    @property
    def missions_per_core(self) -> int:
        """8: on 128 missions at B = 3 `sga-catnipp` took 1.5 times as long with 32, `di` 1.2 times."""
        return 8

    def agent_state(self, observation: Observation, nodes: Belief | None, intent: Vector) -> AgentState:
        """Where the due agent is on its roadmap.

        `nodes` is a belief at its nodes (`Observation.at_nodes`, or one that counts what others announced; None: the
        agent's own), `intent` the others' map. Raises ValueError where the mission was drawn without roadmaps.
        """
        roadmap = roadmap_of(observation)
        meeting = appointment(self.scenario, observation, meet=self.meet)
        return AgentState(
            roadmap=roadmap,
            nodes=observation.belief.on(jnp.asarray(roadmap.nodes)) if nodes is None else nodes,
            here=feasible_edges(self.scenario, observation, meeting),
            position=observation.position,
            remaining=observation.remaining,
            to_next=observation.to_next_measurement,
            intent=intent,
            meeting=meeting,
        )

    def situation(self, observation: Observation, belief: Belief, intent: Vector) -> AgentState:
        """The old name of `agent_state`, for one release."""
        warnings.warn("situation is now agent_state; the next release knows the new name only", DeprecationWarning, 2)
        nodes = jnp.asarray(roadmap_of(observation).nodes)
        return self.agent_state(observation, belief.on(nodes), intent)

    def look(self, situation: AgentState, memory: Memory) -> Insight:
        """Show the situation to the network."""
        where = (situation.here, situation.position, situation.remaining)
        view = policy_view(self.scenario, situation.roadmap, situation.nodes, *where, situation.intent)
        prepared = self.policy.prepare(self.policy.encode(view.features, view.encoding))
        return Insight(view, prepared, *self.policy.decode(prepared, *view[2:], memory))

    def choose(self, key: Key, insight: Insight, *, sampled: bool) -> Index:
        """The neighbour that the policy goes to: its likeliest one, or one drawn."""
        logits = jnp.where(insight.stuck, 0.0, insight.logits)
        if sampled:
            return jax.random.categorical(key, logits / self.temperature).astype(jnp.int32)
        return jnp.argmax(logits).astype(jnp.int32)

    def sample(
        self,
        key: Key,
        situation: AgentState,
        insight: Insight,
        *,
        paths: int,
        steps: int,
        reencode: bool = False,
        distinct: bool = False,
        kept: Int[Array, " j"] | None = None,
    ) -> Paths:
        """Trajectories sampled from the policy; see `sample_paths`.

        `distinct` first steps are drawn without replacement, as far as there are others. `kept` turns, as far as they
        are known (not -1) and allowed, are those of the first path.
        """
        first_key, key = jax.random.split(key)
        logits = jnp.where(insight.view.allowed.any(), insight.logits / self.temperature, 0.0)
        if distinct:
            # Gumbel top-k: sampling without replacement (Kool et al. 2019).
            order = jnp.argsort(-logits - jax.random.gumbel(first_key, logits.shape))
            choices = order[jnp.arange(paths) % jnp.maximum(jnp.sum(insight.view.allowed), 1)]
        else:
            choices = jax.random.categorical(first_key, logits, shape=(paths,))
        if kept is not None:
            choices = choices.at[0].set(follow(kept[0], insight.view.allowed, choices[0]))
        return sample_paths(
            self.scenario,
            self.policy,
            insight.prepared,
            situation,
            choices.astype(jnp.int32),
            insight.memory,
            key,
            steps=steps,
            temperature=self.temperature,
            reencode=reencode,
            kept=kept,
        )

    def outcomes(
        self, belief: Belief, situation: AgentState, paths: Paths
    ) -> tuple[Float[Array, "a q"], Float[Array, "a q"]]:
        """Mean and variance on the evaluation grid after each path, by `belief`."""
        points, taken = path_measurements(self.scenario, situation, paths)
        return predicted(belief, points, taken, virtual_value=self.scenario.virtual_value)


def log_probability(logits: Float[Array, " k"], index: Index) -> Float[Array, ""]:
    """Log-probability of a choice; 0 where nothing may be chosen."""
    possible = jnp.isfinite(logits).any()
    return jnp.where(possible, jax.nn.log_softmax(jnp.where(possible, logits, 0.0))[index], 0.0)
