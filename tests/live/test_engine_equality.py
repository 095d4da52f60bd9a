"""A team that does exactly as it is told travels as in the simulator."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine import draw_missions, reset, run_missions
from maipp.engine.advance import advance
from maipp.engine.observe import turn
from maipp.engine.score import pooled_belief
from maipp.live import LiveSurvey
from maipp.planners import make_planner


def live_routes(survey, team, field):
    """Vertices of every robot's route, and what the survey answers; measured values are the field's."""
    routes = {name: [[0.5, 0.5]] for name in survey.setup.robots}

    def handle(event):
        if event["event"] == "measurement":
            event["value"] = float(field(jnp.asarray([event["position"]], jnp.float32))[0])
        answer = survey.handle(event)
        if answer["answer"] == "go":
            routes[event["robot"]] += answer["waypoints"]
        return answer

    team(handle, {name: [0.5, 0.5] for name in routes})
    return [np.array(route) for route in routes.values()]


@pytest.mark.parametrize("name", ["greedy", "shared-greedy"])
def test_the_routes_are_those_of_run_missions(scenario, team, name):
    planner = make_planner(name, scenario)
    missions = draw_missions(scenario, seed=4, instances=1)
    state = jax.tree.map(lambda a: a[0], run_missions(planner, missions, jax.random.key(0)))
    mission = jax.tree.map(lambda a: a[0], missions)
    with LiveSurvey.from_scenario(scenario, name, seed=4) as survey:
        routes = live_routes(survey, team, mission.field)
        for agent, route in enumerate(routes):
            simulated = np.asarray(state.route[agent][: state.route_length[agent]])
            np.testing.assert_allclose(route, simulated, atol=2e-6)
        belief = pooled_belief(mission, state)
        answer = survey.belief()
    np.testing.assert_allclose(answer["mean"], belief.mean, atol=1e-4)
    np.testing.assert_allclose(answer["std"], belief.std, atol=1e-3)


@eqx.filter_jit
def _engine_step(scenario, planner, mission, state, key, decided):
    """One event of the engine, its randomness keyed as live surveys key it: by agent and number of its decision."""
    state, agent, observation = turn(mission, state)
    memory = jax.tree.map(lambda a: a[agent], state.memory)
    key = jax.random.fold_in(jax.random.fold_in(key, agent), decided[agent])
    decision = planner.decide(key, observation, memory)
    return advance(planner, mission, state, agent, decision), decided.at[agent].add(1)


@pytest.mark.parametrize("name", ["random", pytest.param("receding-horizon", marks=pytest.mark.slow)])
def test_with_the_same_keys_random_planners_travel_as_in_the_engine(scenario, team, name):
    # One gradient step: the second is scaled by how slopes differ, and makes hundredths of a leg of rounding.
    options = {"horizon": 2, "candidates": 16, "elites": 2, "steps": 1, "points": 32} if "horizon" in name else {}
    planner = make_planner(name, scenario, options)
    drawn = draw_missions(scenario, seed=4, instances=1, planner=planner)
    mission = jax.tree.map(lambda a: a[0], drawn)
    state, decided = reset(planner, mission), jnp.zeros(scenario.agents, jnp.int32)
    while state.active.any():
        state, decided = _engine_step(scenario, planner, mission, state, jax.random.key(4), decided)
    with LiveSurvey.from_scenario(scenario, name, options, seed=4) as survey:
        routes = live_routes(survey, team, mission.field)
    for agent, route in enumerate(routes):
        simulated = np.asarray(state.route[agent][: state.route_length[agent]])
        new = np.concatenate([[True], np.hypot(*np.diff(simulated, axis=0).T) > 1e-5])
        # Rounding differs by the number of slots, and a search in the plane carries it on.
        np.testing.assert_allclose(route, simulated[new], atol=1e-5 if name == "random" else 2e-4)
