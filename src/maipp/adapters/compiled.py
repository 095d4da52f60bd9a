"""The environment as the host calls it: few arrays in and out, since each costs as much as a part of a decision.

Programs are keyed on the rules and the shapes: scenarios that differ in numbers only share them.
"""

from collections.abc import Callable
from functools import partial, wraps
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.adapters.kernels import OPTIONS, few_kernels
from maipp.adapters.packed import Packed, Packing
from maipp.engine.mission import Mission
from maipp.engine.reward import final_reward
from maipp.environments.environment import Environment, EnvState, Info
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
    real = jnp.result_type(float)
    return jnp.concatenate(
        [vector.astype(real), allowed.astype(real), jnp.stack([jnp.asarray(n, real) for n in numbers])]
    )


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

    def params(self, world: Packed) -> Mission:
        """The world."""
        return Mission(shape=self.shape, **self.world.unpack(world))

    def open(self, now: Packed, world: Packed) -> tuple[EnvState, Mission]:
        """State and params."""
        params = self.params(world)
        state = self.survey.unpack(now)
        field = jax.tree.map(lambda a: a[0], params.field)
        return state._replace(key=jax.random.key(0), field=field), params

    def close(self, state: EnvState) -> Packed:
        """The state, to be opened again."""
        return self.survey.pack(_bare(state))


def _bare(state: EnvState) -> EnvState:
    return state._replace(key=None, field=None)  # type: ignore[arg-type]


def kinds_of(rules: Environment, shape: Shape, parts: dict[str, Any]) -> Kinds:
    """The kinds of this world, from `mission_parts`, and of surveys in it."""

    def begun(parts: dict[str, Any]) -> EnvState:
        return _bare(rules.begin(jax.random.key(0), Mission(shape=shape, **parts)))

    return Kinds(shape, Packing.of(parts), Packing.of(jax.eval_shape(begun, parts)))


def _in_few_kernels(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function of the rules, the kinds and arrays."""

    @partial(jax.jit, static_argnums=(0, 1), compiler_options=OPTIONS)
    def run(rules: Environment, kinds: Kinds, *arrays: Any) -> Any:
        return few_kernels(partial(function, rules, kinds))(*arrays)

    return wraps(function)(run)


@_in_few_kernels
def first(rules: Environment, kinds: Kinds, world: Packed) -> tuple[Packed, Rows]:
    """The survey when its first agent is due."""
    params = kinds.params(world)
    state, seen, info = rules.reset_to(jax.random.key(0), params, jnp.int32(0))
    return kinds.close(state), _of_turn(rules, seen, jnp.zeros(()), info)


@_in_few_kernels
def before_first(rules: Environment, kinds: Kinds, world: Packed) -> Packed:
    """The survey before anybody has seen anything."""
    return kinds.close(rules.begin(jax.random.key(0), kinds.params(world)))


@_in_few_kernels
def play(rules: Environment, kinds: Kinds, now: Packed, world: Packed, action: Any, stop: Any) -> tuple[Packed, Rows]:
    """The due agent acts, or stops; then the next one's turn."""
    state, params = kinds.open(now, world)
    state, seen, gained, info = rules.step_on(state, action, params, stop)
    return kinds.close(state), _of_turn(rules, seen, gained, info)


@_in_few_kernels
def glance(rules: Environment, kinds: Kinds, now: Packed, world: Packed, agent: Any) -> Rows:
    """What one agent would see now."""
    state, params = kinds.open(now, world)
    return _of_seen(rules, agent, look(rules, state, agent, params), False)


@_in_few_kernels
def together(
    rules: Environment, kinds: Kinds, now: Packed, world: Packed, actions: Any, acting: Any, stops: Any
) -> tuple[Packed, Rows]:
    """Those who act set off or stop; then everybody's row when the next one arrives."""
    state, params = kinds.open(now, world)
    state, replaced = act(rules, state, actions, acting, stops, params)
    state, seen = look_all(rules, state, params)
    rows = jax.vmap(partial(_of_seen, rules))(jnp.arange(params.shape.agents), seen, replaced)
    return kinds.close(state), rows


@partial(jax.jit, static_argnums=0)
def whole(kinds: Kinds, now: Packed, world: Packed, time: Any) -> Any:
    """The global state at this time."""
    state, params = kinds.open(now, world)
    return whole_state(state, time, params)


@partial(jax.jit, static_argnums=0)
def opened(kinds: Kinds, now: Packed, world: Packed) -> EnvState:
    """The state in its parts."""
    return kinds.open(now, world)[0]


def told(rows: Rows, size: int, row: int | None = None) -> Sight:
    """A row on the host; `size` numbers of it are the vector's, `row` is the one of many."""
    packed, graph = rows
    packed = np.asarray(packed) if row is None else np.asarray(packed)[row]
    if graph is not None:
        graph = jax.tree.map(lambda a: np.asarray(a) if row is None else np.asarray(a)[row], graph)
    agent, time, remaining, trace, gained, final, *flags = packed[-len(NUMBERS) :].tolist()
    allowed = packed[size : -len(NUMBERS)] > 0
    vector = packed[:size].astype(np.float32)
    return Sight(vector, allowed, graph, int(agent), time, remaining, trace, gained, final, *map(bool, flags))
