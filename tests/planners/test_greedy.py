"""The greedy steps: against scoring every neighbour by conditioning anew."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from sklearn.gaussian_process.kernels import Matern

from maipp.engine import draw_missions, reset, run_missions
from maipp.engine.observe import due_agent, hear, knowledge, observe
from maipp.engine.rollout import step
from maipp.planners.greedy import Greedy
from maipp.planners.lookahead import predicted_trace
from maipp.planners.roadmap.edges import feasible_edges
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=3, budget=1.0, grid=10, nodes=25, neighbours=6)
KEY = jax.random.key(0)
EVENTS = 18


@pytest.fixture(scope="module")
def mission():
    return jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=6, instances=1))


@eqx.filter_jit
def events(scenario, planner, mission):
    """Observation and decision of the first events of a mission."""

    def event(state, _):
        agent = due_agent(mission, state)
        now = jnp.where(state.active.any(), state.arrival[agent], state.time)
        there = eqx.tree_at(lambda s: s.time, state, jnp.maximum(state.time, now))
        there, heard = hear(mission, there, agent)
        observation = observe(mission, knowledge(mission, there, agent, heard))
        decision = planner.decide(KEY, observation, ())
        return step(planner, mission, state, KEY), (observation, decision, state.active.any())

    return lax.scan(event, reset(planner, mission), length=EVENTS)[1]


def refit(x, y, grid):
    """Posterior mean and variance in NumPy, with the noise of the scenario."""
    joint = np.asarray(Matern(SCENARIO.length_scale, nu=1.5)(np.concatenate([x, grid])))
    gram, cross = joint[: len(x), : len(x)] + SCENARIO.noise * np.eye(len(x)), joint[: len(x), len(x) :]
    weights = np.linalg.solve(gram, cross)
    return y @ weights, 1.0 - np.sum(cross * weights, axis=0)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("virtual_value", ["mean", "zero"])
def test_the_best_neighbour_is_chosen(mission, shared, virtual_value):
    """The lowest predicted Tr(P), counting what the others announced, where the planner does."""
    scenario = SCENARIO.replace(virtual_value=virtual_value)
    saw, decided, running = jax.tree.map(np.asarray, events(scenario, Greedy(scenario, shared=shared), mission))
    grid = np.asarray(mission.grid, np.float64)
    checked = 0
    for e in np.flatnonzero(running & ~decided.stop):
        known = saw.known[e]
        x, y = saw.measurement_x[e][known].astype(np.float64), saw.measurement_y[e][known]
        roadmap = jax.tree.map(lambda a, e=e: a[e], saw.roadmap)
        here = int(np.argmin(np.linalg.norm(roadmap.nodes - saw.position[e], axis=1)))
        targets = roadmap.nodes[roadmap.neighbours[here]]
        announced = np.zeros((0, 2))
        if shared:
            announced = saw.messages[e][saw.heard[e] & np.isfinite(saw.messages[e][:, 0])]
        scores = []
        for target in targets:
            virtual = np.concatenate([announced, target[None]])
            values = np.zeros(len(virtual)) if virtual_value == "zero" else refit(x, y, virtual)[0]
            mean, variance = refit(np.concatenate([x, virtual]), np.concatenate([y, values]), grid)
            scores.append(variance[mean + np.sqrt(np.maximum(variance, 0)) >= SCENARIO.threshold].sum())
        taken = np.flatnonzero(np.isclose(targets, decided.waypoints[e], atol=1e-6).all(axis=1))
        assert len(taken) == 1
        # A grid point at the threshold may count or not, by rounding.
        assert scores[taken[0]] <= min(scores) * (1 + 1e-3)
        checked += max(scores) > 1.01 * min(scores)
        if shared:
            np.testing.assert_array_equal(decided.message[e], decided.waypoints[e, 0])
    assert checked > 9


def test_agents_that_share_part_at_once(mission):
    """From one start, on one roadmap, without news, all go the same way: unless they know where the others go."""
    one = jax.tree.map(lambda a: jnp.broadcast_to(a[:1], a.shape), mission.roadmap)
    alike = eqx.tree_at(lambda m: m.roadmap, mission, one)
    first = {shared: events(SCENARIO, Greedy(SCENARIO, shared=shared), alike)[1] for shared in (False, True)}
    assert len(np.unique(np.asarray(first[False].waypoints[:3, 0]), axis=0)) == 1
    assert len(np.unique(np.asarray(first[True].waypoints[:3, 0]), axis=0)) == 3


def test_agents_out_of_range_have_no_influence():
    """Agent 0 never hears the others; where they are sent changes nothing for it."""
    scenario = SCENARIO.replace(comm_range=1e-6)
    missions = draw_missions(scenario, seed=6, instances=1)
    planner = Greedy(scenario, shared=True)
    before = run_missions(planner, missions, KEY)
    others = eqx.tree_at(
        lambda m: (m.roadmap, m.params.budgets),
        missions,
        (
            jax.tree.map(lambda a: a.at[:, 1:].set(jnp.flip(a[:, 1:], axis=1)), missions.roadmap),
            missions.params.budgets.at[:, 1].set(0.3),
        ),
    )
    after = run_missions(planner, others, KEY)
    assert not np.allclose(after.route[0, 1, :3], before.route[0, 1, :3])
    np.testing.assert_allclose(after.route[0, 0], before.route[0, 0], atol=1e-6)


def test_a_neighbour_whose_trace_is_not_a_number_is_not_chosen(mission, monkeypatch):
    """NaN is no best; where all that the budget allows are NaN, it is still one of those."""
    scenario = SCENARIO.replace(last_leg="stop")
    saw = events(SCENARIO, Greedy(SCENARIO), mission)[0]
    observation = jax.tree.map(lambda a: a[4], saw)
    here = feasible_edges(scenario, observation)
    observation = eqx.tree_at(lambda o: o.remaining, observation, jnp.sort(here.lengths)[3])
    allowed = np.asarray(feasible_edges(scenario, observation).allowed)
    assert 1 < allowed.sum() < len(allowed)

    def chosen(nan):
        def some_nan(*arguments, **options):
            return jnp.where(jnp.asarray(nan), jnp.nan, predicted_trace(*arguments, **options))

        monkeypatch.setattr("maipp.planners.greedy.predicted_trace", some_nan)
        target = Greedy(scenario).decide(KEY, observation, ()).waypoints[0]
        return int(np.argmin(np.linalg.norm(here.targets - target, axis=1)))

    edges = np.arange(len(allowed))
    best = chosen(edges < 0)
    second = chosen(edges == best)
    assert allowed[best] and allowed[second] and second != best
    assert chosen(allowed & (edges != second)) == second
    assert allowed[chosen(edges >= 0)]
