"""The paths that an intent is fitted to, at one decision of one survey (Yang et al. 2023, Fig. 3)."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import draw_missions, reset
from maipp.engine.observe import turn
from maipp.engine.rollout import step
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.planners.intent import IntentPlanner
from maipp.scenario import Scenario
from maipp.team import Intent, destination_intent, trajectory_intent
from maipp.typing import Bool, Float


class SampledPaths(NamedTuple):
    """What one decision samples, and both Gaussians fitted to it."""

    position: Float[np.ndarray, "2"]  # where the agent is, domain units
    paths: Float[np.ndarray, "a j 2"]  # nodes of the sampled paths
    taken: Bool[np.ndarray, "a j"]  # False beyond the budget
    nodes: Float[np.ndarray, "n 2"]  # of the agent's roadmap
    destination: Intent  # DI: fitted to the last node of each path
    trajectory: Intent  # TI: fitted to all nodes of all paths


def sampled_paths(scenario: Scenario, *, paths: int, steps: int, decision: int, seed: int) -> SampledPaths:
    """The paths at the given decision (0: the first) of the team in the first mission of a seed, planned by `ti`.

    Raises `InputError` where the mission has fewer decisions.
    """
    planner = make_planner("ti", scenario, {"paths": paths, "steps": steps})
    assert isinstance(planner, IntentPlanner)
    drawn = draw_missions(scenario, seed=seed, instances=1, planner=planner)
    mission = jax.tree.map(lambda array: array[0], drawn)
    key = jax.random.fold_in(jax.random.key(seed), 0)
    state = reset(planner, mission)
    advance = eqx.filter_jit(step)
    for _ in range(decision):
        state = advance(planner, mission, state, key)
    if not bool(state.active.any()):
        raise InputError(f"decision {decision}: the mission ends before; give a smaller number")
    state, agent, observation = turn(mission, state)
    memory = jax.tree.map(lambda array: array[agent], state.memory)
    look = eqx.filter_jit(IntentPlanner.trajectories)
    nodes, taken = look(planner, jax.random.fold_in(key, state.events), observation, memory)
    assert observation.roadmap is not None
    return SampledPaths(
        np.asarray(observation.position),
        np.asarray(nodes),
        np.asarray(taken),
        np.asarray(observation.roadmap.nodes),
        jax.tree.map(np.asarray, destination_intent(jnp.asarray(nodes), jnp.asarray(taken))),
        jax.tree.map(np.asarray, trajectory_intent(jnp.asarray(nodes), jnp.asarray(taken))),
    )
