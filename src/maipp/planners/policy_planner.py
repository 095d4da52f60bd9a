"""What every planner with a policy network shares: its weights, and what the network is shown."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.errors import InputError
from maipp.planners.policy_paths import Situation
from maipp.planners.policy_view import PolicyView, policy_view
from maipp.planners.roadmap_step import current_node, roadmap_of
from maipp.policy import Memory, PolicyNetwork, Prepared, network_named
from maipp.simulator.decision import Decision, Observation, Planner, PyTree
from maipp.typing import Array, Float, Index, Key, Vector


class Choice(NamedTuple):
    """A decision as a trainer needs it."""

    view: PolicyView  # what the network was shown
    memory: Memory  # of the network before the decision
    index: Index  # the neighbour chosen
    log_probability: Float[Array, ""]  # of choosing it, at temperature 1
    value: Float[Array, ""]  # the network's value of the situation


class Insight(NamedTuple):
    """What the network makes of a situation."""

    view: PolicyView
    prepared: Prepared
    logits: Float[Array, " k"]
    value: Float[Array, ""]
    memory: Memory  # after the situation


class PolicyPlanner(Planner):
    """Base of the planners that ask a policy network."""

    weights: str = eqx.field(static=True, default="ti")  # shipped weights, a .safetensors file, or untrained
    temperature: float = eqx.field(static=True, default=1.0)  # of the softmax that steps are sampled from
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
        return Situation(
            roadmap=roadmap,
            nodes=belief.on(jnp.asarray(roadmap.nodes)),
            node=current_node(roadmap, observation.position),
            position=observation.position,
            remaining=observation.remaining,
            to_next=observation.to_next_measurement,
            intent=intent,
        )

    def look(self, situation: Situation, memory: Memory) -> Insight:
        """Show the situation to the network."""
        where = (situation.node, situation.position, situation.remaining)
        view = policy_view(self.scenario, situation.roadmap, situation.nodes, *where, situation.intent)
        prepared = self.policy.prepare(self.policy.encode(view.features, view.encoding))
        return Insight(view, prepared, *self.policy.decode(prepared, *view[2:], memory))


def log_probability(logits: Float[Array, " k"], index: Index) -> Float[Array, ""]:
    """Log-probability of a choice; 0 where nothing may be chosen."""
    possible = jnp.isfinite(logits).any()
    return jnp.where(possible, jax.nn.log_softmax(jnp.where(possible, logits, 0.0))[index], 0.0)
