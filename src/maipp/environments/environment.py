"""A survey as a pure environment for `jax.jit`, `jax.vmap` and `jax.lax.scan`, as in gymnax and Jumanji.

The team acts in turns: one step is one decision of the agent that is due, which is the one that arrives first.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from maipp.engine.decision import Observation
from maipp.engine.mission import Field, Mission, draw_missions
from maipp.engine.observe import begin_event
from maipp.engine.reward import RewardKind, final_reward, reward
from maipp.engine.rows import pick, put
from maipp.engine.state import State
from maipp.engine.state import reset as begin
from maipp.environments.announcer import Announcer
from maipp.environments.form import REWARDS, Block, Form, check_form, check_option, local_bounds
from maipp.environments.moves import Action, move, options, sight, view_here
from maipp.environments.view import Graph, View
from maipp.errors import InputError
from maipp.problem import ScenarioLike
from maipp.roadmap import Roadmap
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Index, Key

FIELDS = ("any", "own")


class EnvState(NamedTuple):
    """A survey in progress. With the params it is all that a step depends on."""

    key: Key  # of the worlds that follow
    row: Index  # which of the params' worlds it is in
    field: Any  # the ground truth, a pytree callable on points
    survey: State  # the engine's
    due: Index  # the agent that acts next
    before: Float[Array, " m"]  # Tr(P) of each agent's own belief at its last decision; NaN before the first
    over: Bool[Array, " m"]  # agents that ended their survey by a waypoint on the spot


class EnvObservation(NamedTuple):
    """What the agent that is due sees."""

    vector: Float[Array, " d"]  # float32: own, team and candidate blocks (docs/pettingzoo.md, "Spaces")
    action_mask: Bool[Array, " k"]  # what it may do; all of it where its action is not read
    graph: Graph | None  # its roadmap, under view="graph"


class Info(NamedTuple):
    """What is no part of the observation; times and lengths in the scenario's units."""

    agent: Index  # that is due
    time: Float[Array, ""]
    remaining: Float[Array, ""]  # what is left of its budget
    trace: Float[Array, ""]  # Tr(P) of its own belief
    ended: Bool[Array, ""]  # its survey has ended: this is its last turn, and its action is not read
    truncated: Bool[Array, ""]  # it ended for want of room in the record of its route
    last: Bool[Array, ""]  # it is the last of its team to end: the next step is done, and begins a new world
    replaced: Bool[Array, ""]  # the action just taken was not allowed, and the nearest allowed one was


class Specs(NamedTuple):
    """Shapes and bounds, for networks and spaces."""

    num_actions: int  # k; 0 where actions are waypoints
    action: jax.ShapeDtypeStruct
    observation: Any  # an `EnvObservation` of `jax.ShapeDtypeStruct`
    bounds: Block  # of the vector


Stepped = tuple[EnvState, EnvObservation, Float[Array, ""], Bool[Array, ""], Info]


@dataclass(frozen=True)
class Environment:
    """A team's survey, one decision a step. Hashable, so that it may be a static argument.

    **Worlds.** Params are a batch of missions, from `params()` or `maipp.draw_missions`. A reset, within the compiled
    step, draws one of them for the start, the roadmaps and the numbers, and one for the field: b missions make b^2
    worlds (b with `fields="own"`). They are drawn beforehand because roadmaps are made on the host, where no-go zones
    are polygons, and because under `vmap` every step pays for a reset, whether a world ends or not: to look up a row
    costs next to nothing, to draw and normalise a mixture as much as the decision itself.

    **Turns.** `reward` is that of the agent that is due now for its decision before, and for its end. An agent that
    can go nowhere any more is due a last time (`info.ended`); whatever its action is then, it stops.
    """

    scenario: Scenario
    actions: str = "neighbour"  # an action is the index of a roadmap neighbour; or "waypoint": (2,) domain units
    view: str = "local"  # or "graph"
    reward: str = "paper"  # or "log-trace", which sums to that of the whole survey
    fields: str = "any"  # of any of the params' worlds; or "own": of the world that has the start and the roadmaps

    def __post_init__(self) -> None:
        """Raises InputError for options that make no sense, or not together."""
        check_form(self.scenario, self.form)
        check_option("reward", self.reward, REWARDS)
        check_option("fields", self.fields, FIELDS)

    @property
    def form(self) -> Form:
        """What actions are and what agents see."""
        return Form(self.actions, self.view)

    @property
    def kind(self) -> RewardKind:
        """Which reward it is."""
        return cast(RewardKind, self.reward)

    @property
    def specs(self) -> Specs:
        """Shapes and bounds of actions and observations."""
        k = self.scenario.neighbours
        bounds = local_bounds(self.scenario)
        vector = jax.ShapeDtypeStruct(bounds.low.shape, jnp.float32)
        graph: Any = None
        if self.view == "graph":
            parts: Any = [jax.ShapeDtypeStruct(*each) for each in _graph(self.scenario.nodes, k)]
            graph = Graph(*parts)
        leaves: Any = vector, jax.ShapeDtypeStruct((k,), jnp.bool_), graph
        seen = EnvObservation(*leaves)
        if self.actions == "neighbour":
            return Specs(k, jax.ShapeDtypeStruct((), jnp.int32), seen, bounds)
        return Specs(0, jax.ShapeDtypeStruct((2,), jnp.result_type(float)), seen, bounds)

    def params(self, *, seed: int, worlds: int = 256, field: Field | None = None) -> Mission:
        """Worlds to reset to: instances 0 to `worlds - 1` of this seed, as `maipp.evaluate` has them.

        `field` is a ground truth of one's own, a pytree that is a function of points; a random mixture without one.
        """
        roadmaps = self.actions == "neighbour"
        return draw_missions(self.scenario, seed=seed, instances=worlds, roadmaps=roadmaps, field=field)

    def reset(self, key: Key, params: Mission) -> tuple[EnvState, EnvObservation]:
        """A new world, and what the first agent sees in it."""
        state, seen, *_ = self._wake(self._draw(key, params), params)
        return state, seen

    def reset_to(self, key: Key, params: Mission, row: Index) -> tuple[EnvState, EnvObservation, Info]:
        """The world of this row with its own field: for comparisons in pairs."""
        state, seen, _, info = self._wake(self.begin(key, params, row), params)
        return state, seen, info

    def begin(self, key: Key, params: Mission, row: Index | int = 0) -> EnvState:
        """The world of this row with its own field, before its first event."""
        return self._start(key, params, jnp.asarray(row), jax.tree.map(lambda a: a[row], params.field))

    def step(self, state: EnvState, action: Action, params: Mission) -> Stepped:
        """One decision, and the next agent's turn: state, observation, reward, done, info.

        A masked action is replaced by the allowed one that leads nearest to where it would. When all agents have
        stopped, `done` is true and everything else is already of a new world, whose reward is 0.
        """
        moved, replaced = self.move(state, action, params)
        key, fresh_key = jax.random.split(state.key)
        done = ~moved.survey.active.any()
        fresh = self._draw(fresh_key, params)
        going = moved._replace(key=key)
        begun = jax.tree.map(lambda new, old: jnp.where(done, new, old), fresh._replace(key=key), going)
        begun = lax.optimization_barrier(begun)  # fused with what follows, a CPU computes parts of it over and over
        state, seen, gained, info = self._wake(begun, params)
        return state, seen, gained, done, info._replace(replaced=replaced)

    def step_on(
        self, state: EnvState, action: Action, params: Mission, stop: Bool[Array, ""]
    ) -> tuple[EnvState, EnvObservation, Float[Array, ""], Info]:
        """A step without a reset at the end; with `stop` the agent stops, and its action is not read."""
        moved, replaced = lax.optimization_barrier(self.move(state, action, params, stop))
        state, seen, gained, info = self._wake(moved, params)
        return state, seen, gained, info._replace(replaced=replaced)

    def move(
        self, state: EnvState, action: Action, params: Mission, stop: Bool[Array, ""] | bool = False
    ) -> tuple[EnvState, Bool[Array, ""]]:
        """The due agent sets off or stops; whether its action was replaced."""
        agent = state.due
        mission, roadmap = mission_of(params, state), self.roadmap(params, state.row, agent)
        stop = pick(state.over, agent) | stop
        moved = move(self.form, mission, roadmap, state.survey, agent, action, stop)
        return state._replace(survey=moved.state, over=put(state.over, agent, moved.stays, ~stop)), moved.replaced

    def _draw(self, key: Key, params: Mission) -> EnvState:
        """A world drawn from the params."""
        key, row_key, field_key = jax.random.split(key, 3)
        worlds = params.start.shape[0]
        row = jax.random.randint(row_key, (), 0, worlds)
        of = row if self.fields == "own" else jax.random.randint(field_key, (), 0, worlds)
        if self.fields == "any" and params.prior is not None:
            raise InputError("params: samples from before the survey are of each mission's own field; fields='own'")
        return self._start(key, params, row, jax.tree.map(lambda a: a[of], params.field))

    def _start(self, key: Key, params: Mission, row: Index, field: Any) -> EnvState:
        agents, real = params.shape.agents, params.start.dtype
        nobody, unknown = jnp.zeros(agents, bool), jnp.full(agents, jnp.nan, real)
        unbegun = EnvState(key, row.astype(jnp.int32), field, None, jnp.int32(0), unknown, nobody)  # type: ignore[arg-type]
        return unbegun._replace(survey=begin(Announcer(params.problem), mission_of(params, unbegun)))

    def roadmap(self, params: Mission, row: Index, agent: Index) -> Roadmap | None:
        """The agent's own, and no other one's, of the pool."""
        return jax.tree.map(lambda a: a[row, agent], params.roadmap) if self.actions == "neighbour" else None

    def _wake(self, state: EnvState, params: Mission) -> tuple[EnvState, EnvObservation, Float[Array, ""], Info]:
        """The turn of the agent that arrives next: what it sees, and what its decision before has come to."""
        mission = mission_of(params, state)
        survey, agent, observation = begin_event(mission, state.survey)
        roadmap = self.roadmap(params, state.row, agent)
        observation = eqx.tree_at(lambda o: o.roadmap, observation, roadmap, is_leaf=lambda x: x is None)
        there = options(mission, roadmap, survey, agent)
        there = there._replace(allowed=there.allowed & ~pick(state.over, agent))
        view = sight(self.form, mission, survey, observation, there)
        ended = ~there.allowed.any()
        truncated = ended & there.full
        gained = worth(self.kind, pick(state.before, agent), view.trace)
        gained += jnp.where(ended & ~truncated, final_reward(self.kind, view.trace), 0.0)
        last = ended & (jnp.sum(survey.active) <= 1)
        info = Info(agent, survey.time, view.remaining, view.trace, ended, truncated, last, jnp.asarray(False))
        before = put(state.before, agent, view.trace, jnp.asarray(True))
        return state._replace(survey=survey, due=agent, before=before), observation_of(view), gained, info


def mission_of(params: Mission, state: EnvState) -> Mission:
    """The world of a state, without roadmaps: one agent's is looked up when it is needed."""
    bare = eqx.tree_at(lambda m: (m.field, m.roadmap, m.truth), params, (None, None, None), is_leaf=lambda x: x is None)
    world = jax.tree.map(lambda a: a[state.row], bare)
    truth = state.field(world.grid)
    return eqx.tree_at(lambda m: (m.field, m.truth), world, (state.field, truth), is_leaf=lambda x: x is None)


def worth(kind: RewardKind, before: Float[Array, ""], trace: Float[Array, ""]) -> Float[Array, ""]:
    """The reward of a decision, from Tr(P) of the agent's own belief then and now; 0 where there was none before."""
    first = jnp.isnan(before)
    return jnp.where(first, 0.0, reward(kind, jnp.where(first, trace, before), trace))


def observation_of(view: View) -> EnvObservation:
    """The view in the form in which learners take it."""
    vector = jnp.concatenate([part.ravel() for part in (view.own, view.team, view.candidates)])
    return EnvObservation(vector, view.allowed | ~view.allowed.any(), view.graph)


def see(problem: ScenarioLike, observation: Observation, view: str = "local") -> EnvObservation:
    """What a planner's agent sees, as an environment shows it: for planners that ask a policy trained in one.

    `problem` is the planner's `self.scenario`. `action_mask` is all False where the agent can go nowhere.
    """
    form = Form("waypoint" if observation.roadmap is None else "neighbour", view)
    here = view_here(problem, form, observation)
    return observation_of(here)._replace(action_mask=here.allowed)


def _graph(n: int, k: int) -> tuple[tuple[tuple[int, ...], Any], ...]:
    """Shape and type of the parts of a graph."""
    return ((n, 5), jnp.float32), ((n, k), jnp.int32), ((n, k), jnp.bool_), ((), jnp.int32)
