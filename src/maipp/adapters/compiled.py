"""The environment as the host calls it: few arrays in and out, since each costs as much as a part of a decision.

Programs are keyed on the rules and the shapes: scenarios that differ in numbers only share them.
"""

import math
from collections.abc import Callable
from functools import partial, wraps
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.adapters.kernels import OPTIONS, few_kernels
from maipp.adapters.packed import Packing, Words, real, word
from maipp.engine.mission import Mission
from maipp.engine.reward import final_reward
from maipp.environments.environment import Environment, EnvObservation, EnvState, Info
from maipp.environments.together import Seen, act, look, look_all
from maipp.environments.view import Graph
from maipp.environments.whole import whole_state
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


def _of_seen(rules: Environment, agent: Any, seen: Seen, replaced: Any) -> Rows:
    """An agent's row that is due, or is looked at only."""
    view, final = seen.view, final_reward(rules.kind, seen.view.trace)
    stuck = ~view.allowed.any() & seen.due
    ended, truncated = stuck & ~seen.full, stuck & seen.full
    gained = seen.gained + jnp.where(ended, final, 0.0)
    vector = jnp.concatenate([part.ravel() for part in (view.own, view.team, view.candidates)])
    flags = ended, truncated, replaced, seen.due, False
    numbers = agent, seen.time, view.remaining, view.trace, gained, final, *flags
    return _row(vector, view.allowed, *numbers), view.graph


class Kinds(NamedTuple):
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
) -> Kinds:
    """The kinds of this world, from `mission_parts`, and of surveys in it.

    `seen` has shapes and types of an observation; with `agents` there are so many rows, else one.
    """

    def begun(parts: dict[str, Any]) -> EnvState:
        return _bare(rules.begin(jax.random.key(0), Mission(shape=shape, **parts)))

    row = Packing.of((_row_shape(seen), seen.graph))
    rows = row if agents is None else row._replace(parts=tuple(((agents, *size), kind) for size, kind in row.parts))
    return Kinds(shape, Packing.of(parts), Packing.of(jax.eval_shape(begun, parts)), row, rows)


def _row_shape(seen: EnvObservation) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((seen.vector.size + seen.action_mask.size + len(NUMBERS),), real())


def _in_few_kernels(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function of the rules, the kinds and arrays."""

    @partial(jax.jit, static_argnums=(0, 1), compiler_options=OPTIONS)
    def run(rules: Environment, kinds: Kinds, *arrays: Any) -> Any:
        return few_kernels(partial(function, rules, kinds))(*arrays)

    return wraps(function)(run)


@_in_few_kernels
def first(rules: Environment, kinds: Kinds, world: Words) -> Words:
    """The survey when its first agent is due."""
    params = kinds.params(world)
    state, seen, info = rules.reset_to(jax.random.key(0), params, jnp.int32(0))
    return kinds.close(_of_turn(rules, seen, jnp.zeros(()), info), state)


@_in_few_kernels
def before_first(rules: Environment, kinds: Kinds, world: Words) -> Words:
    """The survey before anybody has seen anything."""
    return kinds.close(None, rules.begin(jax.random.key(0), kinds.params(world)))


@_in_few_kernels
def play(rules: Environment, kinds: Kinds, now: Words, world: Words, choice: Any) -> Words:
    """The due agent acts, or stops; then the next one's turn. `choice` is its action, 1, and whether it stops."""
    state, params = kinds.open(now, world)
    action, _, stop = _chosen(choice)
    state, seen, gained, info = rules.step_on(state, action, params, stop)
    return kinds.close(_of_turn(rules, seen, gained, info), state)


@_in_few_kernels
def glance(rules: Environment, kinds: Kinds, now: Words, world: Words, agent: Any) -> Words:
    """The row of what one agent would see now."""
    state, params = kinds.open(now, world)
    return kinds.row.pack(_of_seen(rules, agent, look(rules, state, agent, params), False))


@_in_few_kernels
def together(rules: Environment, kinds: Kinds, now: Words, world: Words, choices: Any) -> Words:
    """Those who act set off or stop; then everybody's row when the next one arrives.

    `choices` are, of each agent, its action, whether it acts, and whether it stops instead.
    """
    state, params = kinds.open(now, world)
    state, replaced = act(rules, state, *_chosen(choices), params)
    state, seen = look_all(rules, state, params)
    rows = jax.vmap(partial(_of_seen, rules))(jnp.arange(params.shape.agents), seen, replaced)
    return kinds.close(rows, state)


def _chosen(choice: Any) -> tuple[Any, Any, Any]:
    """Action, whether there is one, and whether the agent stops: of one agent, or of all. Waypoints are reals."""
    action = choice[..., :-2] if jnp.issubdtype(choice.dtype, jnp.floating) else choice[..., 0]
    return action, choice[..., -2] > 0, choice[..., -1] > 0


@partial(jax.jit, static_argnums=0)
def whole(kinds: Kinds, now: Words, world: Words, time: Any) -> Any:
    """The global state at this time."""
    state, params = kinds.open(now, world)
    return whole_state(state, time, params)


@partial(jax.jit, static_argnums=0)
def opened(kinds: Kinds, now: Words, world: Words) -> EnvState:
    """The state in its parts."""
    return kinds.open(now, world)[0]


def told(kinds: Kinds, words: Words, size: int) -> Sight:
    """What an agent was told, on the host, from the words of its row; `size` numbers are the vector's."""
    numbers, graph = _rows(kinds.row, words)
    return _sight(numbers[:size].astype(np.float32), numbers[size : -len(NUMBERS)] > 0, graph, numbers[-len(NUMBERS) :])


def told_all(kinds: Kinds, words: Words, size: int) -> list[Sight]:
    """What every agent was told, on the host."""
    numbers, graphs = _rows(kinds.rows, words)
    vectors, allowed = numbers[:, :size].astype(np.float32), numbers[:, size : -len(NUMBERS)] > 0
    rows = zip(vectors, allowed, numbers[:, -len(NUMBERS) :], strict=True)
    return [
        _sight(vector, may, None if graphs is None else jax.tree.map(lambda a, i=i: a[i], graphs), row)
        for i, (vector, may, row) in enumerate(rows)
    ]


def _rows(packing: Packing, words: Words) -> Rows:
    """The rows at the beginning of these words, on the host."""
    here, (shape, kind) = np.asarray(words), packing.parts[0]
    if len(packing.parts) > 1:
        return packing.unpack(here[: packing.size])
    return here[: math.prod(shape)].view(kind).reshape(shape), None


def _sight(vector: np.ndarray, allowed: np.ndarray, graph: Graph | None, numbers: np.ndarray) -> Sight:
    agent, time, remaining, trace, gained, final, *flags = numbers.tolist()
    return Sight(vector, allowed, graph, int(agent), time, remaining, trace, gained, final, *map(bool, flags))
