"""The batch engine, one event at a time."""

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.engine import draw_missions, reset
from maipp.engine.advance import set_off
from maipp.engine.decide import decide
from maipp.engine.observe import due_agent, hear, knowledge
from maipp.engine.rows import pick
from maipp.planners import make_planner
from maipp.problem import shape_of


@jax.jit
def _wake(mission, state):
    """The first half of an event, up to what the due agent knows."""
    agent = due_agent(mission, state)
    state = eqx.tree_at(lambda s: s.time, state, jnp.maximum(state.time, pick(state.arrival, agent)))
    state, heard = hear(mission, state, agent)
    return state, knowledge(mission, state, agent, heard)


_set_off = eqx.filter_jit(set_off)


class Stepped:
    """The batch engine, stepped from the host, its randomness keyed as live surveys key it."""

    def __init__(self, scenario, planner, slots, seed, prior=None):
        name, options = planner
        planner = make_planner(name, scenario, options)
        shape = shape_of(scenario, slots=slots)
        drawn = draw_missions(scenario, seed=seed, instances=1, planner=planner, shape=shape, prior=prior)
        self.mission = jax.tree.map(lambda a: a[0], drawn)
        self.planner = planner.on(self.mission.problem)
        self.state = reset(self.planner, self.mission)
        self.decided, self.key = [0] * scenario.agents, jax.random.key(seed)

    @property
    def going(self):
        return bool(self.state.active.any())

    def known(self):
        """What the due agent knows."""
        self.state, known = _wake(self.mission, self.state)
        return known

    def decide(self, known):
        """What it decides, and the state after it."""
        agent = int(known.agent)
        key = jax.random.fold_in(jax.random.fold_in(self.key, agent), self.decided[agent])
        memory = jax.tree.map(lambda a: a[agent], self.state.memory)
        made = decide(self.planner, self.mission, key, known, memory)
        self.state = _set_off(self.mission, self.state, known.agent, made)
        self.decided[agent] += 1
        return jax.device_get(made)
