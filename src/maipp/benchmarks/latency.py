"""How long one decision takes: missions stepped from the host, one at a time, compilation excluded."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from maipp.engine import Decision, Mission, Planner, State, reset
from maipp.engine.advance import advance
from maipp.engine.observe import turn
from maipp.scenario import Scenario
from maipp.typing import Float, Index, Key


class DecisionTime(NamedTuple):
    """The time of single decisions at batch 1, in milliseconds."""

    median: float
    p95: float
    decisions: int  # decisions timed


def _steps(scenario: Scenario, planner: Planner) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """One event in two compiled halves: what the due agent computes, and what the simulator does with it."""
    arrays, static = eqx.partition(planner, eqx.is_array)

    @jax.jit
    def decide(arrays: Any, mission: Mission, state: State, key: Key) -> tuple[State, Index, Decision]:
        state, agent, observation = turn(scenario, mission, state)
        memory = jax.tree.map(lambda array: array[agent], state.memory)
        key = jax.random.fold_in(key, state.events)
        return state, agent, eqx.combine(arrays, static).decide(key, observation, memory)

    @jax.jit
    def proceed(mission: Mission, state: State, agent: Index, decision: Decision) -> State:
        return advance(scenario, planner, mission, state, agent, decision)

    return lambda *inputs: decide(arrays, *inputs), proceed


def first_decision_seconds(
    scenario: Scenario, planner: Planner, missions: Mission, key: Key, *, least: int = 50
) -> tuple[float, Float[np.ndarray, " decisions"]]:
    """Wall time of the very first decision, compilation included, and of every decision after compiling; seconds.

    A decision lasts from observing to the waypoints. Missions are taken until `least` decisions are timed, at least
    one and at most the whole batch.
    """
    decide, proceed = _steps(scenario, planner)
    first = 0.0
    seconds: list[float] = []
    for i in range(missions.start.shape[0]):
        mission = jax.tree.map(lambda array, i=i: array[i], missions)
        mission_key = jax.random.fold_in(key, i)
        state = reset(scenario, planner, mission)
        if i == 0:
            begun = time.perf_counter()
            jax.block_until_ready(decide(mission, state, mission_key))
            first = time.perf_counter() - begun
        while bool(state.active.any()):
            jax.block_until_ready(state)
            begun = time.perf_counter()
            decided = jax.block_until_ready(decide(mission, state, mission_key))
            seconds.append(time.perf_counter() - begun)
            state = proceed(mission, *decided)
        if len(seconds) >= least:
            break
    return first, np.asarray(seconds)


def decision_seconds(
    scenario: Scenario, planner: Planner, missions: Mission, key: Key, *, least: int = 50
) -> Float[np.ndarray, " decisions"]:
    """Wall time of every decision of the first missions of a batch, seconds; see `first_decision_seconds`."""
    return first_decision_seconds(scenario, planner, missions, key, least=least)[1]


def decision_time(
    scenario: Scenario, planner: Planner, missions: Mission, key: Key, *, least: int = 50
) -> DecisionTime:
    """Median and 95th percentile of `decision_seconds`, in milliseconds."""
    milliseconds = 1e3 * decision_seconds(scenario, planner, missions, key, least=least)
    return DecisionTime(
        float(np.median(milliseconds)), float(np.percentile(milliseconds, 95)), int(milliseconds.shape[0])
    )
