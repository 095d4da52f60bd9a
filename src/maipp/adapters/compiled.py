"""The environment as the host calls it: few arrays in and out, since each costs as much as a part of a decision.

Programs belong to rules and shapes: scenarios that differ in numbers only share them.
"""

import math
from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.adapters.kernels import OPTIONS, few_kernels
from maipp.adapters.packed import Packing, Words, real, word
from maipp.engine.mission import Mission
from maipp.engine.reward import final_reward
from maipp.environments.agent_observation import AgentObservation, act, observe_agent, observe_agents
from maipp.environments.environment import Environment, EnvObservation, EnvState, Info
from maipp.environments.global_state import global_state
from maipp.environments.view import Graph
from maipp.problem import Shape

# Numbers behind the vector and the mask of each row that comes back.
NUMBERS = ("agent", "time", "remaining", "trace", "gained", "final", "ended", "truncated", "replaced", "due", "last")


class Sight(NamedTuple):
    """What an agent was told at a moment, on the host."""

    vector: np.ndarray  # (d,) float32
    allowed: np.ndarray  # (k,) bool; all False where its survey has ended
    graph: Graph | None
    agent: int
    time: float
    remaining: float
    trace: float
    gained: float  # reward of its last decision, and of its end where that has come
    final: float  # what its end here would be worth
    ended: bool
    truncated: bool  # it ended for want of room
    replaced: bool
    due: bool
    last: bool  # nobody else of its team is left

    @property
    def end(self) -> bool:
        """Whether its survey is over, one way or the other."""
        return self.ended or self.truncated


Rows = tuple[Any, Graph | None]


def _row(vector: Any, allowed: Any, *numbers: Any) -> Any:
    return jnp.concatenate([*(each.astype(real()) for each in (vector, allowed)), jnp.stack(list(map(_real, numbers)))])


def _real(number: Any) -> Any:
    return jnp.asarray(number, real())


def _of_turn(rules: Environment, seen: Any, gained: Any, info: Info) -> Rows:
    """The due agent's row."""
    allowed = seen.action_mask & ~info.ended
    ended = info.ended & ~info.truncated
    final = final_reward(rules.kind, info.trace)
    flags = ended, info.truncated, info.replaced, True, info.last
    numbers = info.agent, info.time, info.remaining, info.trace, gained, final, *flags
    return _row(seen.vector, allowed, *numbers), seen.graph


def _of_seen(rules: Environment, agent: Any, seen: AgentObservation, replaced: Any) -> Rows:
    """An agent's row that is due, or is looked at only."""
    view, final = seen.view, final_reward(rules.kind, seen.view.trace)
    stuck = ~view.allowed.any() & seen.due
    ended, truncated = stuck & ~seen.full, stuck & seen.full
    gained = seen.gained + jnp.where(ended, final, 0.0)
    vector = jnp.concatenate([part.ravel() for part in (view.own, view.team, view.candidates)])
    flags = ended, truncated, replaced, seen.due, False
    numbers = agent, seen.time, view.remaining, view.trace, gained, final, *flags
    return _row(vector, view.allowed, *numbers), view.graph


class EnvPackings(NamedTuple):
    """What the packed world and survey are; hashable."""

    shape: Shape
    world: Packing  # of the parts of a `Mission` with a leading axis of one
    survey: Packing  # of an `EnvState` without key and field, which are those of the world
    row: Packing  # of an agent's row
    rows: Packing  # of the rows that come with the survey: that of the due agent, or those of all

    def params(self, world: Words) -> Mission:
        """The world."""
        return Mission(shape=self.shape, **self.world.unpack(world))

    def open(self, now: Words, world: Words) -> tuple[EnvState, Mission]:
        """State and params."""
        params = self.params(world)
        state = self.survey.unpack(now[self.rows.size :])
        field = jax.tree.map(lambda a: a[0], params.field)
        return state._replace(key=jax.random.key(0), field=field), params

    def close(self, rows: Rows | None, state: EnvState) -> Words:
        """The rows, zeros where there are none, and the state after them, to be opened again: all in one array."""
        told = jnp.zeros(self.rows.size, word()) if rows is None else self.rows.pack(rows)
        return jnp.concatenate([told, self.survey.pack(_bare(state))])


def _bare(state: EnvState) -> EnvState:
    return state._replace(key=None, field=None)  # type: ignore[arg-type]


def kinds_of(
    rules: Environment, shape: Shape, parts: dict[str, Any], seen: EnvObservation, agents: int | None = None
) -> EnvPackings:
    """The kinds of this world, from `mission_parts`, and of surveys in it.

    `seen` has shapes and types of an observation; with `agents` there are so many rows, else one.
    """

    def begun(parts: dict[str, Any]) -> EnvState:
        return _bare(rules.begin(jax.random.key(0), Mission(shape=shape, **parts)))

    row = Packing.of((_row_shape(seen), seen.graph))
    rows = row if agents is None else row._replace(parts=tuple(((agents, *size), kind) for size, kind in row.parts))
    return EnvPackings(shape, Packing.of(parts), Packing.of(jax.eval_shape(begun, parts)), row, rows)


def _row_shape(seen: EnvObservation) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((seen.vector.size + seen.action_mask.size + len(NUMBERS),), real())


class Calls:
    """The compiled calls of these rules, for worlds and surveys of these kinds.

    A choice is an agent's action, whether it acts, and whether it stops instead: one array, of reals for waypoints.
    """

    def __init__(self, rules: Environment, kinds: EnvPackings) -> None:
        self.rules, self.kinds = rules, kinds
        compile_few = partial(jax.jit, compiler_options=OPTIONS)
        self.hold: Callable[..., Words] = jax.jit(jnp.copy)  # on the device: `device_put` takes several times as long
        self.first: Callable[..., Words] = compile_few(few_kernels(self._first))
        self.before_first: Callable[..., Words] = compile_few(few_kernels(self._before_first))
        self.play: Callable[..., Words] = compile_few(few_kernels(self._play))
        self.glance: Callable[..., Words] = compile_few(few_kernels(self._glance))
        self.together: Callable[..., Words] = compile_few(few_kernels(self._together))

    def _first(self, world: Words) -> Words:
        """The survey when its first agent is due."""
        state, seen, info = self.rules.reset_to(jax.random.key(0), self.kinds.params(world), jnp.int32(0))
        return self.kinds.close(_of_turn(self.rules, seen, jnp.zeros(()), info), state)

    def _before_first(self, world: Words) -> Words:
        """The survey before anybody has seen anything."""
        return self.kinds.close(None, self.rules.begin(jax.random.key(0), self.kinds.params(world)))

    def _play(self, now: Words, world: Words, choice: Any) -> Words:
        """The due agent acts, or stops; then the next one's turn."""
        state, params = self.kinds.open(now, world)
        action, _, stop = _chosen(choice)
        state, seen, gained, info = self.rules.step_on(state, action, params, stop)
        return self.kinds.close(_of_turn(self.rules, seen, gained, info), state)

    def _glance(self, now: Words, world: Words, agent: Any) -> Words:
        """The row of what one agent would see now."""
        state, params = self.kinds.open(now, world)
        return self.kinds.row.pack(_of_seen(self.rules, agent, observe_agent(self.rules, state, agent, params), False))

    def _together(self, now: Words, world: Words, choices: Any) -> Words:
        """Those who act set off or stop; then everybody's row when the next one arrives. `choices` are of all."""
        state, params = self.kinds.open(now, world)
        state, replaced = act(self.rules, state, *_chosen(choices), params)
        state, seen = observe_agents(self.rules, state, params)
        rows = jax.vmap(partial(_of_seen, self.rules))(jnp.arange(params.shape.agents), seen, replaced)
        return self.kinds.close(rows, state)


@cache
def calls_of(rules: Environment, kinds: EnvPackings) -> Calls:
    """The compiled calls, the same for all environments: to find them by their keys at each step takes longer."""
    return Calls(rules, kinds)


def _chosen(choice: Any) -> tuple[Any, Any, Any]:
    """Action, whether there is one, and whether the agent stops: of one agent, or of all. Waypoints are reals."""
    action = choice[..., :-2] if jnp.issubdtype(choice.dtype, jnp.floating) else choice[..., 0]
    return action, choice[..., -2] > 0, choice[..., -1] > 0


@partial(jax.jit, static_argnums=0)
def whole(kinds: EnvPackings, now: Words, world: Words, time: Any) -> Any:
    """The global state at this time."""
    state, params = kinds.open(now, world)
    return global_state(state, time, params)


@partial(jax.jit, static_argnums=0)
def opened(kinds: EnvPackings, now: Words, world: Words) -> EnvState:
    """The state in its parts."""
    return kinds.open(now, world)[0]


def told(kinds: EnvPackings, words: Words, size: int) -> Sight:
    """What an agent was told, on the host, from the words of its row; `size` numbers are the vector's."""
    numbers, graph = _rows(kinds.row, words)
    return _sight(
        numbers[:size].astype(np.float32), numbers[size : -len(NUMBERS)] > 0, graph, numbers[-len(NUMBERS) :].tolist()
    )


def told_all(kinds: EnvPackings, words: Words, size: int) -> list[Sight]:
    """What every agent was told, on the host."""
    rows, graphs = _rows(kinds.rows, words)
    vectors, allowed = rows[:, :size].astype(np.float32), rows[:, size : -len(NUMBERS)] > 0
    numbers = rows[:, -len(NUMBERS) :].tolist()
    graph_of: Any = [None] * len(numbers)
    if graphs is not None:
        graph_of = [jax.tree.map(lambda a, i=i: a[i], graphs) for i in range(len(numbers))]
    return list(map(_sight, vectors, allowed, graph_of, numbers))


def _rows(packing: Packing, words: Words) -> Rows:
    """The rows at the beginning of these words, on the host."""
    here, (shape, kind) = np.asarray(words), packing.parts[0]
    if len(packing.parts) > 1:
        return packing.unpack(here[: packing.size])
    return here[: math.prod(shape)].view(kind).reshape(shape), None


def _sight(vector: np.ndarray, allowed: np.ndarray, graph: Graph | None, numbers: list[float]) -> Sight:
    agent, time, remaining, trace, gained, final, *flags = numbers
    return Sight(vector, allowed, graph, int(agent), time, remaining, trace, gained, final, *map(bool, flags))
