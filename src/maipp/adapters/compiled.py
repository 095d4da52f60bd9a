"""The environment as the host calls it: few arrays in and out, since each costs as much as a part of a decision.

Programs are keyed on the rules and the shapes: scenarios that differ in numbers only share them.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine.mission import Mission
from maipp.engine.reward import final_reward
from maipp.environments.environment import Environment, EnvState, Info
from maipp.environments.together import Seen, act, look, look_all
from maipp.environments.view import Graph
from maipp.environments.whole import whole_state

# Numbers behind the vector and the mask of each row that comes back.
NUMBERS = ("agent", "time", "remaining", "trace", "gained", "final", "ended", "truncated", "replaced", "due")


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

    @property
    def end(self) -> bool:
        """Whether its survey is over, one way or the other."""
        return self.ended or self.truncated


Leaves = tuple[Any, ...]
Rows = tuple[Any, Graph | None]


def _row(vector: Any, allowed: Any, *numbers: Any) -> Any:
    real = jnp.result_type(float)
    return jnp.concatenate([vector.astype(real), allowed.astype(real), jnp.stack([jnp.asarray(n, real) for n in numbers])])


def _of_turn(rules: Environment, seen: Any, gained: Any, info: Info) -> Rows:
    """The due agent's row."""
    allowed = seen.action_mask & ~info.ended
    ended = info.ended & ~info.truncated
    final = final_reward(rules.reward, info.trace)
    numbers = info.agent, info.time, info.remaining, info.trace, gained, final, ended, info.truncated, info.replaced, 1
    return _row(seen.vector, allowed, *numbers), seen.graph


def _of_seen(rules: Environment, agent: Any, seen: Seen, replaced: Any) -> Rows:
    """An agent's row that is due, or is looked at only."""
    view, final = seen.view, final_reward(rules.reward, seen.view.trace)
    stuck = ~view.allowed.any() & seen.due
    ended, truncated = stuck & ~seen.full, stuck & seen.full
    gained = seen.gained + jnp.where(ended, final, 0.0)
    vector = jnp.concatenate([part.ravel() for part in (view.own, view.team, view.candidates)])
    numbers = agent, seen.time, view.remaining, view.trace, gained, final, ended, truncated, replaced, seen.due
    return _row(vector, view.allowed, *numbers), view.graph


def _opened(kinds: Any, leaves: Leaves, params: Leaves) -> tuple[EnvState, Mission]:
    return jax.tree.unflatten(kinds[0], leaves), jax.tree.unflatten(kinds[1], params)


@partial(jax.jit, static_argnums=0)
def first(rules: Environment, params: Mission) -> tuple[EnvState, Rows]:
    """The only world of the params, when its first agent is due."""
    state, seen, info = rules.reset_to(jax.random.key(0), params, jnp.int32(0))
    return state, _of_turn(rules, seen, jnp.zeros(()), info)


@partial(jax.jit, static_argnums=0)
def before_first(rules: Environment, params: Mission) -> EnvState:
    """The only world of the params before anybody has seen anything."""
    return rules.begin(jax.random.key(0), params)


@partial(jax.jit, static_argnums=(0, 1))
def play(rules: Environment, kinds: Any, leaves: Leaves, params: Leaves, action: Any, stop: Any) -> tuple[Leaves, Rows]:
    """The due agent acts, or stops; then the next one's turn."""
    state, mission = _opened(kinds, leaves, params)
    state, seen, gained, info = rules.step_on(state, action, mission, stop)
    return tuple(jax.tree.leaves(state)), _of_turn(rules, seen, gained, info)


@partial(jax.jit, static_argnums=(0, 1))
def glance(rules: Environment, kinds: Any, leaves: Leaves, params: Leaves, agent: Any) -> Rows:
    """What one agent would see now."""
    state, mission = _opened(kinds, leaves, params)
    return _of_seen(rules, agent, look(rules, state, agent, mission), False)


@partial(jax.jit, static_argnums=(0, 1))
def together(
    rules: Environment, kinds: Any, leaves: Leaves, params: Leaves, actions: Any, acting: Any, stops: Any
) -> tuple[Leaves, Rows]:
    """Those who act set off or stop; then everybody's row when the next one arrives."""
    state, mission = _opened(kinds, leaves, params)
    state, replaced = act(rules, state, actions, acting, stops, mission)
    state, seen = look_all(rules, state, mission)
    rows = jax.vmap(partial(_of_seen, rules))(jnp.arange(mission.shape.agents), seen, replaced)
    return tuple(jax.tree.leaves(state)), rows


@partial(jax.jit, static_argnums=0)
def whole(kinds: Any, leaves: Leaves, params: Leaves, time: Any) -> Any:
    """The global state at this time."""
    state, mission = _opened(kinds, leaves, params)
    return whole_state(state, time, mission)


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
