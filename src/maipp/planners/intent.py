"""`di`, `ti`, `ti-star`, `intent-paths`: agents sample their own future, tell it as a Gaussian, and move by the policy.

Source: Yang et al. 2023, Sec. IV-B (intent), IV-C (policy), V (DI, TI and TI*).
"""

import dataclasses
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.belief import Belief, to_rank
from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option, part
from maipp.errors import InputError
from maipp.foresight import Foresight, ForesightName
from maipp.planners.announced.announced_measurements import latest
from maipp.planners.announced.intents import with_intents
from maipp.planners.paths.path_sampler import Choice, PathSampler
from maipp.planners.paths.paths import AgentState, Paths
from maipp.planners.roadmap.edges import roadmap_of
from maipp.planners.search.prospect import aim_of, check_aim, foresight_for, prospect_of
from maipp.policy import Memory
from maipp.problem import longest_side
from maipp.team import COVARIANCE_FLOOR, Intent, destination_intent, fuse_intents, no_intent, trajectory_intent
from maipp.team.intent import is_announced
from maipp.typing import Array, Float, Index, Int, Key

# Smoothing of the area's border where paths are ranked by what they are expected to leave, field units.
_BLUR = 0.02
_SPREAD = 0.3


class Recollection(NamedTuple):
    """What an agent remembers from decision to decision."""

    trajectory: Memory  # the network's, of the executed trajectory
    intents: Intent  # last heard from each agent, leading axis m
    plan: Int[Array, " j"]  # what is left of the best path, as turns at each node; -1 from where there is none


class IntentPlanner(Planner):
    """Samples `paths` trajectories of `steps` nodes from the policy, and tells the others a Gaussian fitted to them."""

    sampler: PathSampler = part(PathSampler)
    foreseer: Foresight | None = eqx.field(default=None, kw_only=True)  # None: the one named, if it is needed
    paths: int = option(8, meaning="trajectories sampled per decision: a")
    steps: int = option(5, meaning="nodes of each path: j")
    distinct: bool = option(False, meaning="the paths' first steps differ, as far as they can")
    intent: Literal["trajectory", "destination"] = option(
        "trajectory", meaning="told of each path: all its nodes (TI), or its last one (DI)"
    )
    choose: Literal["likeliest", "sample", "best"] = option("likeliest", meaning="the next node")
    mode: Literal["encode-once", "reencode"] = option("encode-once", meaning="how the network sees virtual steps")
    rank: Literal["expected", "intents", "stationary"] = option(
        "intents",
        meaning="paths by Tr(P) predicted with the others stationary, with their intents, or expected with both",
    )
    spread: float = option(_SPREAD, meaning="trust in the belief's spread of values not yet measured")
    share: Literal["samples", "best"] = option("samples", meaning="paths the intent is fitted to")
    listen: bool = option(True, meaning="False: as if no intent were heard")
    keep: bool = option(False, meaning="what is left of the last best path competes again")
    recall: bool = option(True, meaning="of agents out of range, count on the last intent heard")
    foresight: ForesightName = option("protocol", meaning="rank=expected: who says what the field will be")
    aim: float | None = option(None, meaning="weight of places likely of interest; None: 0.55, for protocol 0")

    uses_roadmap = True
    avoids_obstacles = True

    def check(self) -> None:
        """Raise InputError for options out of range."""
        for name in ("paths", "steps"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}={getattr(self, name)}: give a whole number >= 1")
        if not self.spread >= 0:
            raise InputError(f"spread={self.spread}: give a number >= 0")
        check_aim(self.aim)
        if self.foreseer is not None and self.rank != "expected":
            raise InputError(f"foresight={self.foresight}: paths are ranked by rank={self.rank}; give rank=expected")
        if self.foreseer is not None and self.spread != _SPREAD:
            raise InputError(f"spread={self.spread}: a foresight, or an aim, has a spread of its own; leave it out")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.foreseer = foresight_for(self.foresight, self.aim, self.scenario, self.foreseer)

    def empty_message(self) -> PyTree:
        """The intent: mean (2,) and covariance (3,), five numbers; NaN before the first decision."""
        return no_intent()

    def initial_memory(self) -> PyTree:
        """Nothing travelled, nothing heard."""
        intents = jax.tree.map(lambda a: jnp.broadcast_to(a, (self.scenario.agents, *a.shape)), no_intent())
        return Recollection(self.sampler.policy.initial_memory(), intents, jnp.full(self.steps, -1, jnp.int32))

    def counted(self, observation: Observation) -> Belief:
        """The due agent's belief with a few virtual measurements where the others intend to be."""
        heard = observation.heard & self.listen
        value, here = self.scenario.virtual_value, observation.position
        return with_intents(observation.belief, observation.messages, heard, value, here)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next node, and the agent's intent."""
        return self.act(key, observation, memory)[0]

    def act(self, key: Key, observation: Observation, memory: PyTree) -> tuple[Decision, Choice]:
        """The next node with the agent's intent, and what a trainer needs to know of the decision."""
        intents = latest(observation.heard, observation.messages, memory.intents)
        if self.recall:
            # Silence may mean out of range: what was last heard is still the best guess of where that agent measures.
            observation = dataclasses.replace(observation, messages=intents, heard=is_announced(intents))
        heard = observation.heard & self.listen
        nodes = jnp.asarray(roadmap_of(observation).nodes)
        intent = fuse_intents(observation.messages, heard, nodes)
        situation = self.sampler.agent_state(observation, observation.at_nodes, intent)
        insight = self.sampler.look(situation, memory.trajectory)
        path_key, choice_key = jax.random.split(key)
        paths = self.sampler.sample(
            path_key,
            situation,
            insight,
            paths=self.paths,
            steps=self.steps,
            reencode=self.mode == "reencode",
            distinct=self.distinct,
            kept=memory.plan if self.keep else None,
        )
        scores = self._scores(observation, situation, paths) if self._ranks else None
        best = jnp.zeros((), jnp.int32) if scores is None else jnp.argmin(to_rank(scores))
        drawn = self.sampler.choose(choice_key, insight, sampled=self.choose == "sample")
        index = paths.choices[best] if self.choose == "best" else drawn
        stop = insight.stuck
        target = nodes[jnp.where(stop, situation.here.node, insight.view.neighbours[index])]
        rest = jnp.append(paths.turns[best, 1:], -1)
        # Who did not set out along the best path has nothing left of it.
        remembered = Recollection(insight.memory, intents, jnp.where(paths.choices[best] == index, rest, -1))
        decision = Decision(target[None], self._fit(nodes, paths, best, stop), remembered, stop)
        return decision, Choice(situation, insight, memory.trajectory, index, paths, scores)

    def trajectories(self, key: Key, observation: Observation, memory: PyTree) -> tuple[Array, Array]:
        """Positions (a, j, 2) of the paths that `act` samples with the same key, and which of them count (a, j)."""
        paths = self.act(key, observation, memory)[1].paths
        assert paths is not None  # an intent is always fitted to some
        return jnp.asarray(roadmap_of(observation).nodes)[paths.nodes], paths.taken

    @property
    def _ranks(self) -> bool:
        return self.choose == "best" or self.share == "best"

    def _scores(self, observation: Observation, situation: AgentState, paths: Paths) -> Float[Array, " a"]:
        """What each path leaves: the Tr(P) predicted, or expected, at its end."""
        belief = observation.belief if self.rank == "stationary" else self.counted(observation)
        mean, variance = self.sampler.outcomes(belief, situation, paths)
        if self.rank != "expected":
            return self.interest.trace(mean, variance, observation.inside)
        known, inside = observation.belief.variance, observation.inside
        prospect = prospect_of(self.foreseer, observation.belief, self.interest)
        if prospect is not None:
            aim = aim_of(self.foresight, self.aim)
            return prospect.expected_trace(self.interest, variance, known, inside, aim=aim, blur=_BLUR)
        # Who takes planned values for zero has no doubt about them.
        spread = 0.0 if self.scenario.virtual_value == "zero" else self.spread
        return self.interest.expected_trace(mean, variance, known, inside, spread=spread, blur=_BLUR)

    def _fit(self, nodes: Float[Array, "n 2"], paths: Paths, best: Index, stop: Array) -> Intent:
        """The intent; nothing once the agent stops, which must not keep a place claimed."""
        taken = paths.taken & ~stop
        if self.share == "best":
            taken = taken & (jnp.arange(self.paths) == best)[:, None]
        fit = trajectory_intent if self.intent == "trajectory" else destination_intent
        # The floor is that of a unit square; it grows with the survey area.
        return fit(nodes[paths.nodes], taken, COVARIANCE_FLOOR * longest_side(self.scenario.extent) ** 2)
