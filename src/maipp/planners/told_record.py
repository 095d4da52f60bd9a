"""Run missions and keep what every decision told the others: intents and announced measurements."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from maipp.engine import Mission, Planner, State, reset
from maipp.engine.observe import due_agent
from maipp.engine.rollout import refuse_to_cross, step
from maipp.planners.announced import Announcement
from maipp.planners.team_plan import TeamPlan
from maipp.scenario import Scenario
from maipp.team import Intent
from maipp.team.told import Told
from maipp.typing import Array, Bool, Float, Int, Key

# Events between two looks from the host whether any mission still runs.
_EVENTS_PER_CALL = 16


class Recorded(NamedTuple):
    """The decisions of a batch of missions in their order; b missions, e events."""

    states: State  # at the end
    agent: Int[np.ndarray, "b e"]  # that decided
    counts: Bool[np.ndarray, "b e"]  # False where the mission had ended before
    time: Float[np.ndarray, "b e"]  # of the decision
    kept: Any  # (b, e, ...): of the message that was sent


def run_recorded(
    scenario: Scenario, planner: Planner, missions: Mission, key: Key, keep: Callable[[Any], Any]
) -> Recorded:
    """Run missions (leading axis b), and keep `keep(message)` of every decision.

    Mission i draws its randomness from `fold_in(key, i)`, as in `run_missions`, and takes the same course. Raises
    InputError for obstacles that the planner does not avoid.
    """
    refuse_to_cross(scenario, planner)
    arrays, static = eqx.partition(planner, eqx.is_array)
    count = missions.start.shape[0]
    keys = jax.vmap(partial(jax.random.fold_in, key))(jnp.arange(count))

    def event(arrays: Any, mission: Mission, key: Key, state: State, _: None) -> tuple[State, Any]:
        agent, active = due_agent(scenario, state), state.active.any()
        state = step(scenario, eqx.combine(arrays, static), mission, state, key)
        kept = keep(jax.tree.map(lambda row: row[agent], state.messages))
        return state, (agent, active, state.time, kept)

    @jax.jit
    def some(arrays: Any, missions: Mission, keys: Array, states: State) -> tuple[State, Any]:
        def one(mission: Mission, key: Key, state: State) -> tuple[State, Any]:
            return lax.scan(partial(event, arrays, mission, key), state, None, length=_EVENTS_PER_CALL)

        return jax.vmap(one)(missions, keys, states)

    states = jax.jit(jax.vmap(partial(reset, scenario, planner)))(missions)
    told = []
    while bool(states.active.any()):
        states, rows = some(arrays, missions, keys, states)
        told.append(jax.device_get(rows))
    return Recorded(states, *jax.tree.map(lambda *rows: np.concatenate(rows, axis=1), *told))


def tells_plans(planner: Planner) -> bool:
    """Whether the planner's messages are intents or announced measurements, so that `told_in` can read them."""
    return isinstance(planner.empty_message(), Intent | Announcement | TeamPlan)


def told_in(recorded: Recorded, index: int = 0) -> tuple[Told, ...]:
    """What was told in mission `index`, in the order of the decisions; for a run of which whole messages were kept.

    Whoever stops tells nothing any more: its last entry is empty. Raises TypeError for messages of another kind.
    """
    events = np.flatnonzero(recorded.counts[index])
    return tuple(
        _told(
            int(recorded.agent[index, event]),
            float(recorded.time[index, event]),
            jax.tree.map(lambda row, event=event: row[index, event], recorded.kept),
        )
        for event in events
    )


def _told(agent: int, time: float, message: Any) -> Told:
    """One message as what it tells."""
    nothing = np.full(2, np.nan), np.full(3, np.nan)
    if isinstance(message, Intent):
        return Told(
            agent, time, np.asarray(message.mean), np.asarray(message.covariance), np.empty((0, 2)), np.empty(0)
        )
    legs = message.legs if isinstance(message, TeamPlan) else message
    if isinstance(legs, Announcement):
        return Told(agent, time, *nothing, np.asarray(legs.points), np.asarray(legs.times))
    raise TypeError(f"{type(message).__name__} is neither an intent nor an announced path")
