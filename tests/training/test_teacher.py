"""The teacher: how plans in the plane become a choice among the edges of a roadmap."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine.observe import begin_event
from maipp.planners.paths.view import PolicyView
from maipp.planners.roadmap.edges import feasible_edges
from maipp.planners.search.optimiser import Finalists
from maipp.planners.search.plan_search import PlanSearch
from maipp.roadmap import Roadmap
from maipp.training.config import TrainConfig
from maipp.training.learner import Learner
from maipp.training.teacher import Lesson, no_plan, teach
from maipp.training.worlds import agent_roadmap, mission_of

CONFIG = TrainConfig(
    agents=2, budget=(2.0, 2.0), bank=1, shards=1, missions=1, events=2, epochs=1, minibatch=2, paths=2, steps=2,
    imitation=0, search=0, updates=2,
)  # fmt: skip
CENTRE = np.array([0.5, 0.5])
# The agent is at node 0 in the centre; nodes to the east, to the north, twice as far east, and to the west of it.
NODES = CENTRE + np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.3, 0.0], [-0.1, 0.0]])
LENGTHS = np.array([0.1, 0.1, 0.3, 0.1])
EAST, NORTH = np.zeros(4), np.full(4, np.pi / 2)


@pytest.fixture(scope="module")
def seen():
    """The planner, and what the first agent of a new mission observes, on its roadmap."""
    learner = Learner(CONFIG, jax.devices()[:1])
    state = learner.initial()
    planner = learner.planner(state.network)
    environment = jax.tree.map(lambda a: a[0, 0], state.shards.environments)
    mission = mission_of(learner.config, learner.bank, environment.world)
    state, agent, observation = begin_event(mission, environment.state)
    roadmap = agent_roadmap(learner.bank, environment.world, agent)
    return planner, dataclasses.replace(observation, roadmap=roadmap)


@pytest.fixture(scope="module")
def star(seen):
    """The same planner, and an observation at the centre of a roadmap of five nodes."""
    planner, observation = seen
    neighbours = np.tile(np.array([1, 2, 3, 4], np.int32), (5, 1))
    distances = np.tile(LENGTHS.astype(np.float32), (5, 1))
    encoding = np.zeros((5, 32), np.float32)
    roadmap = Roadmap(NODES.astype(np.float32), neighbours, distances, np.ones((5, 4), bool), encoding)
    roadmap = jax.tree.map(jnp.asarray, roadmap)
    return planner, dataclasses.replace(observation, roadmap=roadmap, position=jnp.asarray(CENTRE, jnp.float32))


def lesson_of(planner, observation, allowed, plan, key) -> Lesson:
    """What the teacher would do there, were only these of the edges allowed."""
    here = feasible_edges(planner.scenario, observation)
    unread: dict[str, Any] = dict.fromkeys(PolicyView._fields)
    edges = {"node": here.node, "neighbours": here.target_nodes, "allowed": here.allowed & jnp.asarray(allowed)}
    return teach(planner.scenario, key, observation, observation.belief, PolicyView(**unread | edges), plan)


def choices(headings, allowed=(True, True, True, True)):
    """The soft choice along one straight plan, in float64: as in the docstring of `teach`."""
    ideal = CENTRE + LENGTHS[:, None] * np.array([np.cos(headings[0]), np.sin(headings[0])])
    miss = np.linalg.norm(ideal - NODES[1:], axis=1) - 0.6 * LENGTHS
    powers = np.where(allowed, np.exp(-miss / 0.02), 0.0)
    return powers / powers.sum()


@pytest.mark.parametrize("allowed", [(True, True, True, True), (True, True, False, True), (False, True, False, True)])
def test_each_plan_has_a_say_by_its_value(star, monkeypatch, allowed):
    planner, observation = star
    found = Finalists(jnp.array([EAST, NORTH], jnp.float32), jnp.array([100.0, 108.0]))
    monkeypatch.setattr(PlanSearch, "plan", lambda *args: found)
    lesson = jax.tree.map(np.asarray, lesson_of(planner, observation, allowed, no_plan(), jax.random.key(0)))
    say = (1 / 108) ** (1 / 0.08) / ((1 / 100) ** (1 / 0.08) + (1 / 108) ** (1 / 0.08))
    expected = (1 - say) * choices(EAST, allowed) + say * choices(NORTH, allowed)
    assert 0.2 < say < 0.35  # eight per cent worse: about 1/e of the other's
    np.testing.assert_allclose(lesson.choice, expected, atol=1e-4)
    if allowed == (True, True, True, True):
        # Of two nodes on the plan, the farther one.
        assert np.argmax(lesson.choice) == 2 and lesson.choice[1] == pytest.approx(say, abs=0.05)


def test_where_nothing_is_allowed_there_is_no_choice(star, monkeypatch):
    planner, observation = star
    found = Finalists(jnp.array([EAST, NORTH], jnp.float32), jnp.array([100.0, 108.0]))
    monkeypatch.setattr(PlanSearch, "plan", lambda *args: found)
    lesson = lesson_of(planner, observation, (False,) * 4, no_plan(), jax.random.key(0))
    np.testing.assert_array_equal(lesson.choice, np.zeros(4))


@pytest.mark.parametrize(
    ("allowed", "moves_on"), [((True, True, True, True), True), ((True, True, False, True), False)]
)
def test_the_plan_moves_on_once_the_agent_measures(star, monkeypatch, allowed, moves_on):
    """The first leg is 0.2: the node 0.3 to the east lies behind it, the one at 0.1 does not."""
    planner, observation = star
    assert float(observation.to_next_measurement) == pytest.approx(0.2)
    plan = np.array([0.0, 0.5, 1.0, 1.5])
    found = Finalists(jnp.array([NORTH, plan], jnp.float32), jnp.array([300.0, 1.0]))
    monkeypatch.setattr(PlanSearch, "plan", lambda *args: found)
    lesson = lesson_of(planner, observation, allowed, no_plan(), jax.random.key(0))
    np.testing.assert_allclose(lesson.plan, np.roll(plan, -1) if moves_on else plan, atol=1e-6)


def test_it_goes_to_what_is_worth_it(seen):
    """The real search, where only one side of the agent is part of the survey: that is where it goes."""
    planner, observation = seen
    searched = eqx.filter_jit(lesson_of)
    start, grid = np.asarray(observation.position), np.asarray(observation.belief.query)
    everywhere = np.ones(observation.roadmap.neighbours.shape[1], bool)
    for axis in (0, 1):
        for side in (-1, 1):
            room = start[axis] if side < 0 else 1 - start[axis]
            if room < 0.35:
                continue
            inside = jnp.asarray(side * (grid[:, axis] - start[axis]) > 0.1)
            there = dataclasses.replace(observation, inside=inside)
            lesson = searched(planner, there, everywhere, no_plan(), jax.random.key(1))
            choice = np.asarray(lesson.choice, float)
            assert choice.sum() == pytest.approx(1.0, abs=1e-5) and (choice >= 0).all()
            targets = np.asarray(observation.roadmap.nodes)[np.asarray(observation.roadmap.neighbours)[0]]
            moved = choice @ (targets - start)
            assert side * moved[axis] > 0.03 and lesson.plan.shape == no_plan().shape
