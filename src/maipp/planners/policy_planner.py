"""What every planner with a policy network shares: its weights, and what the network is shown."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Decision, Observation, Planner, PyTree, option
from maipp.errors import InputError
from maipp.planners.edges_here import edges_here
from maipp.planners.lookahead import predicted
from maipp.planners.policy_paths import Paths, Situation, follow, path_measurements, sample_paths
from maipp.planners.policy_view import PolicyView, policy_view
from maipp.planners.rendezvous import appointment
from maipp.planners.roadmap_step import roadmap_of
from maipp.policy import Memory, PolicyNetwork, Prepared, network_named
from maipp.typing import Array, Float, Index, Int, Key, Vector


class Insight(NamedTuple):
    """What the network makes of a situation."""

    view: PolicyView
    prepared: Prepared
    logits: Float[Array, " k"]
    value: Float[Array, ""]
    memory: Memory  # after the situation


class Choice(NamedTuple):
    """A decision as a trainer needs it."""

    situation: Situation  # where the agent was
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


class PolicyPlanner(Planner):
    """Base of the planners that ask a policy network."""

    weights: str = option("ti", meaning="shipped weights, a .safetensors file, or untrained")
    temperature: float = option(1.0, meaning="of the softmax that steps are sampled from")
    meet: bool = option(True, meaning="with limited communication: end where the others end")
    network: PolicyNetwork | None = None  # the network itself, from Python; None: as `weights` says

    uses_roadmap = True
    avoids_obstacles = True

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
        """8: on 128 missions at B = 3 it took `sga-catnipp` 1.5 times as long with 32, `ti-star`, `di` 1.2 times."""
        return 8

    def initial_memory(self) -> PyTree:
        """The network's memory of the executed trajectory."""
        return self.policy.initial_memory()

    def counted(self, observation: Observation) -> Belief:
        """The due agent's belief with what the others announced counted as measured."""
        raise NotImplementedError

    def act(self, key: Key, observation: Observation, memory: PyTree) -> tuple[Decision, Choice]:
        """The decision, and what a trainer needs to know of it."""
        raise NotImplementedError

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next node, and what to tell the others."""
        return self.act(key, observation, memory)[0]

    def situation(self, observation: Observation, belief: Belief, intent: Vector) -> Situation:
        """Where the due agent is on its roadmap; `belief` may count what others announced, `intent` is their map."""
        roadmap = roadmap_of(observation)
        meeting = appointment(self.scenario, observation, meet=self.meet)
        return Situation(
            roadmap=roadmap,
            nodes=belief.on(jnp.asarray(roadmap.nodes)),
            here=edges_here(self.scenario, observation, meeting),
            position=observation.position,
            remaining=observation.remaining,
            to_next=observation.to_next_measurement,
            intent=intent,
            meeting=meeting,
        )

    def look(self, situation: Situation, memory: Memory) -> Insight:
        """Show the situation to the network."""
        where = (situation.here, situation.position, situation.remaining)
        view = policy_view(self.scenario, situation.roadmap, situation.nodes, *where, situation.intent)
        prepared = self.policy.prepare(self.policy.encode(view.features, view.encoding))
        return Insight(view, prepared, *self.policy.decode(prepared, *view[2:], memory))

    def sample(
        self,
        key: Key,
        situation: Situation,
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
        self, belief: Belief, situation: Situation, paths: Paths
    ) -> tuple[Float[Array, "a q"], Float[Array, "a q"]]:
        """Mean and variance on the evaluation grid after each path, by `belief`."""
        points, taken = path_measurements(self.scenario, situation, paths)
        return predicted(belief, points, taken, virtual_value=self.scenario.virtual_value)


def log_probability(logits: Float[Array, " k"], index: Index) -> Float[Array, ""]:
    """Log-probability of a choice; 0 where nothing may be chosen."""
    possible = jnp.isfinite(logits).any()
    return jnp.where(possible, jax.nn.log_softmax(jnp.where(possible, logits, 0.0))[index], 0.0)
