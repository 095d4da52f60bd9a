"""A survey half done, made up: what timing and errors are measured on, without flying the first half."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import Mission, Planner, State, draw_missions, reset
from maipp.problem import params_of, shape_of
from maipp.scenario import Scenario
from maipp.typing import Float

# Standard deviation of the turn at each measurement, radians: about as crooked as the routes of the planners here.
_TURN = 0.9


def walks(rng: np.random.Generator, agents: int, count: int, interval: float) -> Float[np.ndarray, "m c 2"]:
    """Measured positions of agents that set out together and wander over the unit square, `interval` apart (< 1).

    Whoever heads out of the square lingers along its border, so measurements are denser there.
    """
    position = np.broadcast_to(rng.random(2), (agents, 2))
    heading = rng.uniform(-np.pi, np.pi, agents)
    visited = np.empty((agents, count, 2))
    for i in range(count):
        heading = heading + rng.normal(0.0, _TURN, agents)
        # Straight on and mirrored at the borders: a step is less than the side, so nobody is mirrored twice.
        ahead = position + interval * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        position = np.abs(np.where(ahead > 1, 2 - ahead, ahead))
        visited[:, i] = position
    return visited


def under_way(scenario: Scenario, planner: Planner, *, seed: int, count: int) -> tuple[Mission, State]:
    """A mission in which every agent has taken `count` measurements, told them, and is due now.

    The domain is the unit square. One roadmap serves all agents: drawing a hundred takes longer than what is timed.
    """
    alone = scenario.replace(agents=1)
    drawn = draw_missions(alone, seed=seed, instances=1, planner=planner)
    m = scenario.agents
    mission = jax.tree.map(lambda a: a[0], drawn)
    start = jnp.repeat(mission.start, m, axis=0)
    roadmap = jax.tree.map(lambda a: jnp.repeat(jnp.asarray(a), m, axis=0), mission.roadmap)
    mission = dataclasses.replace(mission, shape=shape_of(scenario), params=params_of(scenario), start=start)
    if roadmap is not None:
        mission = eqx.tree_at(lambda m: m.roadmap, mission, roadmap)
    state = reset(planner, mission)
    rng = np.random.default_rng(seed)
    interval = scenario.measurement_interval
    visited = walks(rng, m, count, interval)
    here = visited[:, -1] if roadmap is None else np.asarray(roadmap.nodes[0])[rng.integers(scenario.nodes, size=m)]
    real = state.time.dtype
    x = state.measurement_x.at[:, :count].set(jnp.asarray(visited, real))
    y = state.measurement_y.at[:, :count].set(jax.vmap(mission.field)(x[:, :count]))
    travelled = jnp.full(m, count * interval, real)
    instants = jnp.asarray(interval * np.arange(1, count + 1), real)
    known = jnp.broadcast_to(jnp.arange(state.known.shape[-1]) < count, state.known.shape)
    return mission, eqx.tree_at(
        lambda s: (
            *(s.time, s.leg, s.departure, s.arrival, s.odometer, s.taken),
            *(s.measurement_x, s.measurement_y, s.measurement_time, s.known),
        ),
        state,
        (
            *(travelled[0], jnp.broadcast_to(jnp.asarray(here, real)[:, None], state.leg.shape)),
            *(travelled, travelled, travelled, jnp.full(m, count, jnp.int32)),
            *(x, y, state.measurement_time.at[:, :count].set(instants), known),
        ),
    )
