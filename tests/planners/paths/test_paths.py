"""Sampled paths: along edges, within the budget, and seeing what their own measurements would leave to be known."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shapely.geometry import LineString, Polygon
from sklearn.gaussian_process.kernels import Matern

from maipp.belief import Matern32, condition
from maipp.engine import Decision, Planner, draw_missions, reset
from maipp.engine.advance import advance
from maipp.engine.observe import knowledge, observe
from maipp.planners.intent import IntentPlanner
from maipp.planners.paths.paths import AgentState, path_measurements, sample_paths
from maipp.planners.roadmap.edges import edges
from maipp.roadmap import laplacian_encoding, sample_roadmaps
from maipp.scenario import Scenario

WALL = ((0.4, 0.3), (0.6, 0.3), (0.6, 1.1), (0.4, 1.1))
SCENARIO = Scenario(agents=1, budget=1.4, grid=8, nodes=24, neighbours=6, obstacles=(WALL,))
COUNT, STEPS, MEASURED = 8, 4, 5
KEY = jax.random.key(0)


def roadmap_of(scenario, seed):
    """The roadmap of one agent, with its encoding."""
    start = np.full((1, 2), 0.15)
    shape = {name: getattr(scenario, name) for name in ("nodes", "neighbours", "extent", "obstacles")}
    roadmap = sample_roadmaps(np.random.default_rng(seed), start, **shape)
    roadmap = dataclasses.replace(roadmap, encoding=laplacian_encoding(roadmap, 4))
    real = jnp.result_type(float)
    return jax.tree.map(lambda a: jnp.asarray(a[0], real if a.dtype.kind == "f" else None), roadmap)


def draw(scenario, seed, remaining=None):
    """A situation after some random measurements, and where these are."""
    rng = np.random.default_rng(seed)
    roadmap = roadmap_of(scenario, seed)
    x = rng.random((MEASURED, 2)).astype(np.float32)
    kernel = Matern32(scenario.length_scale, scenario.signal_variance)
    belief = condition(kernel, jnp.asarray(x), jnp.zeros(MEASURED), jnp.ones(MEASURED, bool), jnp.zeros((1, 2)), 1e-6)
    node = int(rng.integers(scenario.nodes))
    left = rng.uniform(0, 1.2) if remaining is None else remaining
    scalar = {"remaining": left, "to_next": rng.uniform(0.01, 0.2)}
    situation = AgentState(
        roadmap=roadmap,
        nodes=belief.on(roadmap.nodes),
        here=edges(roadmap, jnp.int32(node), jnp.float32(left), scenario.last_leg),
        position=roadmap.nodes[node],
        intent=jnp.zeros(scenario.nodes),
        **{name: jnp.float32(value) for name, value in scalar.items()},
    )
    return situation, x


@eqx.filter_jit
def sample(planner, situation, key, temperature=1.0, reencode=False, steps=STEPS):
    """Paths from any of the first steps that are allowed."""
    insight = planner.sampler.look(situation, planner.sampler.policy.initial_memory())
    possible = insight.view.allowed
    choices = jax.random.categorical(key, jnp.where(possible | ~possible.any(), 0.0, -jnp.inf), shape=(COUNT,))
    paths = sample_paths(
        planner.scenario,
        planner.sampler.policy,
        insight.prepared,
        situation,
        choices,
        insight.memory,
        key,
        steps=steps,
        temperature=temperature,
        reencode=reencode,
    )
    return paths, *path_measurements(planner.scenario, situation, paths)


@pytest.mark.parametrize("last_leg", ["cut", "stop"])
def test_paths_follow_allowed_edges_until_the_budget_ends(tiny, last_leg):
    scenario = SCENARIO.replace(last_leg=last_leg)
    planner = IntentPlanner.of(scenario, network=tiny)
    wall = Polygon(WALL).buffer(-1e-5)
    stopped = went = distinct = 0
    for seed in range(12):
        situation, _ = draw(scenario, seed, remaining=0.0 if seed == 0 else None)
        paths = jax.tree.map(np.asarray, sample(planner, situation, jax.random.key(seed))[0])
        roadmap = jax.tree.map(np.asarray, situation.roadmap)
        distinct += len(np.unique(paths.nodes, axis=0)) > 3
        for choice, nodes, taken, length, turns in zip(*paths, strict=True):
            assert (turns[taken] >= 0).all() and (turns[~taken] == -1).all()
            here, left, travelled = int(situation.here.node), float(situation.remaining), 0.0
            for step, (node, go) in enumerate(zip(nodes, taken, strict=True)):
                edge = roadmap.distances[here]
                within = edge <= left + 2e-5 if last_leg == "stop" else np.full(len(edge), left > 0)
                allowed = roadmap.reachable[here] & within
                if not go:
                    assert node == here and not (allowed & (left > 2e-5) & (edge < left - 2e-5)).any()
                    assert not taken[step:].any()
                    stopped += 1
                    continue
                taken_edge = int(turns[step])
                assert step > 0 or taken_edge == choice
                assert roadmap.neighbours[here, taken_edge] == node and allowed[taken_edge]
                travelled, left, here = travelled + edge[taken_edge], left - edge[taken_edge], int(node)
                went += 1
            assert length == pytest.approx(travelled, abs=1e-5)
            if last_leg == "stop":
                assert length <= float(situation.remaining) + 2e-5
            places = roadmap.nodes[[int(situation.here.node), *nodes[taken]]]
            assert not (taken.any() and LineString(places).intersects(wall))
    assert stopped > 20 and went > 100 and distinct > 5


def std_after(x, grid, scenario):
    """Standard deviation after measuring at x, by NumPy and scikit-learn in float64."""
    joint = np.asarray(Matern(scenario.length_scale, nu=1.5)(np.concatenate([x, grid]).astype(np.float64)))
    gram, cross = joint[: len(x), : len(x)] + scenario.noise * np.eye(len(x)), joint[: len(x), len(x) :]
    return np.sqrt(np.maximum(1.0 - np.sum(cross * np.linalg.solve(gram, cross), axis=0), 0.0))


def measured_on_the_way(places, situation, interval):
    """Where an agent measures along a polyline, as far as its budget goes."""
    if len(places) < 2:
        return np.zeros((0, 2))
    line = LineString(places)
    marks = np.arange(float(situation.to_next), min(line.length, float(situation.remaining)) + 1e-5, interval)
    return np.array([line.interpolate(mark).coords[0] for mark in marks]).reshape(-1, 2)


@pytest.mark.parametrize("reencode", [False, True])
def test_a_virtual_step_sees_what_the_measurements_so_far_would_leave(curious, far_sighted, reencode):
    """A network that goes where the deviation is highest goes where conditioning for real says it is."""
    planner = IntentPlanner.of(SCENARIO, network=far_sighted if reencode else curious)
    changed = 0
    for seed in range(10):
        situation, x = draw(SCENARIO, seed, remaining=1.1)
        paths, *_ = sample(planner, situation, jax.random.key(seed), reencode=reencode)
        nodes, taken = np.asarray(paths.nodes), np.asarray(paths.taken)
        roadmap = jax.tree.map(np.asarray, situation.roadmap)
        left = float(situation.remaining)
        before = std_after(x, roadmap.nodes, SCENARIO)
        for path, went in zip(nodes, taken, strict=True):
            for step in range(1, STEPS):
                if not went[step]:
                    continue
                here = int(path[step - 1])
                places = roadmap.nodes[[int(situation.here.node), *path[:step]]]
                passed = measured_on_the_way(places, situation, SCENARIO.measurement_interval)
                std = std_after(np.concatenate([x, passed]), roadmap.nodes, SCENARIO)
                assert LineString(places).length < left
                ends = roadmap.neighbours[here][roadmap.reachable[here]]
                assert std[path[step]] >= std[ends].max() - 2e-3
                changed += before[ends].argmax() != std[ends].argmax()
    assert changed > 10  # the belief from before would have led elsewhere


class Scripted(Planner):
    """Travels given waypoints: one decision with all of them."""

    waypoints: jax.Array

    @property
    def waypoints_per_decision(self) -> int:
        return self.waypoints.shape[0]

    def decide(self, key, observation, memory):
        return Decision(self.waypoints, (), ())


@pytest.mark.parametrize("last_leg", ["cut", "stop"])
def test_paths_measure_where_the_engine_does(tiny, last_leg):
    scenario = Scenario(agents=1, budget=0.9, grid=8, nodes=24, neighbours=6, last_leg=last_leg)
    planner = IntentPlanner.of(scenario, network=tiny)
    mission = jax.tree.map(lambda a: a[0], draw_missions(scenario, seed=3, instances=1, encodings=4))
    agent = jnp.int32(0)

    @eqx.filter_jit
    def go(planner, state):
        state = advance(planner, mission, state, agent, planner.decide(KEY, None, ()))
        return eqx.tree_at(lambda s: s.time, state, state.arrival[0])

    heard = jnp.zeros(1, bool)
    roadmap = jax.tree.map(lambda a: a[0], mission.roadmap)
    cut = measured = 0
    for edge in range(6):
        # One edge for real, then the paths from its end.
        first = Scripted(scenario, jnp.broadcast_to(roadmap.nodes[roadmap.neighbours[0, edge]], (STEPS, 2)))
        state = go(first, reset(first, mission))
        observation = eqx.filter_jit(observe)(mission, knowledge(mission, state, agent, heard))
        situation = planner.sampler.agent_state(observation, observation.at_nodes, jnp.zeros(scenario.nodes))
        assert int(situation.here.node) == int(roadmap.neighbours[0, edge])
        paths, points, taken = sample(planner, situation, jax.random.key(edge))
        for nodes, length, spots, lives in zip(paths.nodes, paths.length, points, taken, strict=True):
            after = go(Scripted(scenario, roadmap.nodes[nodes]), state)
            new = slice(int(state.taken[0]), int(after.taken[0]))
            np.testing.assert_allclose(spots[lives], after.measurement_x[0, new], atol=2e-5)
            cut += float(length) > float(situation.remaining) + 1e-4
            measured += int(lives.sum())
    assert measured > 60 and (cut > 5) == (last_leg == "cut")


def test_one_step_is_the_first_choice_alone(tiny):
    planner = IntentPlanner.of(SCENARIO, network=tiny)
    situation, _ = draw(SCENARIO, 1, remaining=1.0)
    paths = sample(planner, situation, KEY, steps=1)[0]
    assert bool(paths.taken.all()) and len(np.unique(paths.choices)) > 2
    np.testing.assert_array_equal(paths.nodes[:, 0], situation.roadmap.neighbours[situation.here.node, paths.choices])
    np.testing.assert_allclose(paths.length, situation.roadmap.distances[situation.here.node, paths.choices])


def test_a_temperature_of_almost_zero_makes_all_paths_the_likeliest_one(tiny):
    planner = IntentPlanner.of(SCENARIO, network=tiny)
    situation, _ = draw(SCENARIO, 2, remaining=1.1)
    cold, warm = (np.asarray(sample(planner, situation, jax.random.key(4), t)[0].nodes) for t in (1e-6, 1.0))

    def ways(nodes):
        """Distinct paths per first step."""
        return len(np.unique(nodes, axis=0)) / len(np.unique(nodes[:, 0]))

    assert ways(cold) == 1 < ways(warm)
