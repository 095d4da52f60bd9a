"""Surveys that follow a script, for tests of the engine, and the record of one that several files test."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from maipp.engine import Decision, Planner, draw_missions, reset, run_missions
from maipp.engine.episode import Episode
from maipp.engine.episode_io import dump_episode
from maipp.engine.rollout import step
from maipp.planners.random_walk import RandomWalk
from maipp.scenario import Scenario

RECORDED = Scenario.create(agents=2, budget=1.0, grid=8, nodes=12, neighbours=4, comm_range=0.3)


class Scripted(Planner):
    """Travels as told; tells the others how often it has decided; remembers what it saw when it last did."""

    script: jax.Array  # (m, decisions, w, 2)
    halt: jax.Array  # (m, decisions)

    @property
    def waypoints_per_decision(self):
        return self.script.shape[2]

    def empty_message(self):
        return jnp.full((), -1, jnp.int32)

    def initial_memory(self):
        m, q, slots = self.scenario.agents, self.scenario.grid_points, self.scenario.measurements
        return {
            "step": jnp.zeros((), jnp.int32),
            **{name: jnp.zeros(()) for name in ("time", "remaining", "budget", "speed", "to_next_measurement")},
            **{name: jnp.zeros(2) for name in ("position", "start")},
            **{"known": jnp.zeros(slots, bool), "measurement_x": jnp.zeros((slots, 2))},
            **{"measurement_y": jnp.zeros(slots), "mean": jnp.zeros(q), "variance": jnp.zeros(q)},
            **{"heard": jnp.zeros(m, bool), "messages": jnp.zeros(m, jnp.int32), "positions": jnp.zeros((m, 2))},
        }

    def decide(self, key, observation, memory):
        now = memory["step"]
        decisions = self.halt.shape[1]
        at = jnp.minimum(now, decisions - 1)
        saw = {name: getattr(observation, name) for name in memory if name not in ("step", "mean", "variance")}
        saw |= {"step": now + 1, "mean": observation.belief.mean, "variance": observation.belief.variance}
        stop = (now >= decisions) | self.halt[observation.agent, at]
        return Decision(self.script[observation.agent, at], now, saw, stop)


@eqx.filter_jit
def states_of(scenario, planner, mission):
    """All states of a mission, the first one before any decision."""

    def event(state, _):
        after = step(planner, mission, state, jax.random.key(0))
        return after, after

    agents, decisions = planner.halt.shape
    first = reset(planner, mission)
    # Every agent decides once more, to stop; then two events too many.
    _, later = lax.scan(event, first, length=agents * (decisions + 1) + 2)
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, later)


@pytest.fixture(scope="session")
def play():
    """Runs a world: `start` (m, 2), `budgets` and `speeds` (m,), `script` (m, decisions, w, 2), `halt` (m, decisions).

    Gives its mission and all its states as NumPy arrays.
    """
    drawn = {}

    def run(scenario, world):
        if scenario not in drawn:
            drawn[scenario] = jax.tree.map(lambda a: a[0], draw_missions(scenario, seed=3, instances=1, roadmaps=False))
        new = [jnp.asarray(a, jnp.float32) for a in (world.start, world.budgets, world.speeds)]
        mission = eqx.tree_at(lambda m: (m.start, m.params.budgets, m.params.speeds), drawn[scenario], new)
        planner = Scripted(scenario, jnp.asarray(world.script, jnp.float32), jnp.asarray(world.halt))
        return mission, jax.tree.map(np.asarray, states_of(scenario, planner, mission))

    return run


@pytest.fixture(scope="session")
def batch():
    """Two missions of a random walk, and how they ended."""
    missions = draw_missions(RECORDED, seed=5, instances=2)
    return missions, run_missions(RandomWalk(RECORDED), missions, jax.random.key(5))


@pytest.fixture(scope="session")
def episode(batch):
    """The record of the second of them."""
    return Episode.from_state(RECORDED, "random", {}, 5, *batch, index=1)


@pytest.fixture(scope="session")
def text(episode):
    """Its file."""
    return dump_episode(episode)
