"""Steps to the next arrival: everybody sees what it would see alone, whoever hears whom."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp import Environment, Scenario
from maipp.environments.agent_observation import act, believe_alike, observe_agent, observe_agents

ALIKE = Scenario(agents=3, budget=2.0, grid=8, nodes=14, neighbours=4)


@pytest.mark.parametrize(
    ("scenario", "alike"),
    [(ALIKE, True), (ALIKE.replace(comm_range=0.3), False), (ALIKE.replace(belief_capacity=8), False)],
    ids=["all heard", "some heard", "windows"],
)
def test_all_together_see_what_each_would_see_alone(scenario, alike):
    env = Environment(scenario, fields="own")
    params = env.params(seed=3, worlds=1)
    assert believe_alike(params) == alike
    step, see = jax.jit(partial(act, env)), jax.jit(partial(observe_agents, env))
    state, seen = see(env.begin(jax.random.key(0), params), params)
    stops = jnp.zeros(scenario.agents, bool)
    for _ in range(7):
        farthest = scenario.neighbours - 1 - jnp.argmax(seen.view.allowed[:, ::-1], axis=1)  # they are by distance
        state, _ = step(state, farthest, seen.due, stops, params)
        state, seen = see(state, params)
    now = dataclasses.replace(state.survey, time=seen.time[0])
    assert int(now.taken.sum()) > 4 and not seen.due.all()
    for agent in range(scenario.agents):
        alone = jax.jit(partial(observe_agent, env))(state._replace(survey=now), jnp.int32(agent), params)
        for name in ("own", "team", "candidates", "trace", "allowed"):
            np.testing.assert_allclose(
                getattr(seen.view, name)[agent], getattr(alone.view, name), rtol=1e-4, atol=1e-5, err_msg=name
            )
