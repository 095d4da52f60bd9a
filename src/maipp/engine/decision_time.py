"""How long one decision takes: missions stepped from the host, one at a time, compilation excluded."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from maipp.engine import Mission, Planner, State, reset
from maipp.engine.advance import advance
from maipp.engine.rollout import due_decision
from maipp.engine.state import UNDER_WAY
from maipp.typing import Float, Key


class DecisionTime(NamedTuple):
    """The time of single decisions at batch 1, in milliseconds."""

    median: float
    p95: float
    decisions: int  # decisions timed


def event_halves(planner: Planner) -> tuple[partial[Any], partial[Any]]:
    """One event in two compiled halves: what the due agent computes, and what the engine does with it.

    The first takes mission, state and key, the second mission and what the first gave. Planners of one kind with the
    same options share both, whatever their numbers and weights.
    """
    leaves, structure = jax.tree.flatten(planner)
    arrays = [leaf if eqx.is_array(leaf) else None for leaf in leaves]
    static = structure, tuple(None if eqx.is_array(leaf) else leaf for leaf in leaves)
    return partial(_decide, static, arrays), partial(_proceed, static, arrays)


def _joined(static: tuple[Any, tuple[Any, ...]], arrays: list[Any]) -> Planner:
    """The planner that `event_halves` took apart."""
    structure, others = static
    return jax.tree.unflatten(structure, [b if a is None else a for a, b in zip(arrays, others, strict=True)])


@partial(jax.jit, static_argnums=0)
def _decide(static: Any, arrays: list[Any], *inputs: Any) -> Any:
    return due_decision(_joined(static, arrays), *inputs)


@partial(jax.jit, static_argnums=0)
def _proceed(static: Any, arrays: list[Any], *inputs: Any) -> Any:
    return advance(_joined(static, arrays), *inputs)


def compiled_anew(half: partial[Any], *inputs: Any) -> tuple[Any, Callable[..., Any]]:
    """A half compiled for such inputs, whatever has been compiled before: the program, and the half that runs it."""
    static, arrays = half.args
    program = jax.jit(partial(half.func.__wrapped__, static)).lower(arrays, *inputs).compile()
    return program, partial(program, arrays)


def _goes_on(state: State) -> bool:
    """Whether there is a decision left; asked on the host, where it leaves the caches to what is timed."""
    status, full = np.asarray(state.status), np.asarray(state.full)
    return bool(np.isin(status, UNDER_WAY).any() and not full.any())


def timed_decisions(
    halves: tuple[Callable[..., Any], Callable[..., Any]],
    mission: Mission,
    state: State,
    key: Key,
    clock: Callable[[], float] = time.perf_counter,
) -> Iterator[float]:
    """Seconds of each decision of a mission from a state on, from observing to the waypoints."""
    decide, proceed = halves
    while _goes_on(state):
        jax.block_until_ready(state)
        begun = clock()
        decided = jax.block_until_ready(decide(mission, state, key))
        yield clock() - begun
        state = proceed(mission, *decided)


def decision_seconds(
    planner: Planner, missions: Mission, key: Key, *, least: int = 50
) -> tuple[float, Float[np.ndarray, " decisions"]]:
    """Wall time of the very first decision, compilation included, and of every decision after compiling; seconds.

    Missions are taken until `least` decisions are timed, at least one and at most the whole batch.
    """
    halves = event_halves(planner.on(jax.tree.map(lambda array: array[0], missions.problem)))
    first, seconds = 0.0, []
    for i in range(missions.start.shape[0]):
        mission = jax.tree.map(lambda array, i=i: array[i], missions)
        begin = mission, reset(planner, mission), jax.random.fold_in(key, i)
        first = first or next(timed_decisions(halves, *begin), 0.0)
        seconds += timed_decisions(halves, *begin)
        if len(seconds) >= least:
            break
    return first, np.asarray(seconds)


def decision_time(planner: Planner, missions: Mission, key: Key, *, least: int = 50) -> DecisionTime:
    """Median and 95th percentile of `decision_seconds`, in milliseconds."""
    milliseconds = 1e3 * decision_seconds(planner, missions, key, least=least)[1]
    median, p95 = (float(np.percentile(milliseconds, q)) for q in (50, 95))
    return DecisionTime(median, p95, len(milliseconds))
