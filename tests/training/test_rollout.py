"""Sampling: what a decision is recorded as is what happened, whoever it follows."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine.observe import begin_event
from maipp.training import rollout
from maipp.training.config import TrainConfig
from maipp.training.learner import Learner
from maipp.training.losses import ask
from maipp.training.rollout import RolloutState, roll_out, step
from maipp.training.teacher import Lesson
from maipp.training.worlds import mission_of

EVENTS, MISSIONS, AGENTS = 24, 2, 2
CONFIG = TrainConfig(
    agents=AGENTS, budget=(0.6, 0.8), bank=2, shards=1, missions=MISSIONS, events=EVENTS, epochs=1, minibatch=12,
    paths=2, steps=3, imitation=1, search=1, search_paths=4, elites=2, updates=3,
)  # fmt: skip
PHASES = ("imitate", "reinforce", "search")


@pytest.fixture(scope="module")
def learner():
    return Learner(CONFIG, jax.devices()[:1])


@pytest.fixture(scope="module")
def environments(learner):
    """Missions that have just begun, leading axis missions."""
    return jax.tree.map(lambda a: a[0], learner.initial().shards.environments)


@pytest.fixture(scope="module")
def rolled(learner, environments):
    """A function that gives the decisions of a phase, leading axes (events, missions), and the environments after."""
    network = learner.initial().network

    @eqx.filter_jit
    def run(phase, follow):
        planner = learner.planner(network, phase)
        key = jax.random.key(3)
        return roll_out(CONFIG, learner.scenario, planner, learner.bank, environments, key, phase, follow)

    kept = {}

    def of(phase, follow=1.0):
        if (phase, follow) not in kept:
            kept[phase, follow] = jax.tree.map(np.asarray, run(phase, jnp.float32(follow))[1])
        return kept[phase, follow]

    return of


def missions(transitions):
    """The decisions of each mission that ended, in their order: indices (event, mission) for indexing."""
    for column in range(MISSIONS):
        ends = np.flatnonzero(transitions.ended[:, column])
        for begin, end in zip([0, *ends + 1], ends, strict=False):
            yield [(event, column) for event in range(begin, end + 1)]


@pytest.mark.parametrize("phase", PHASES)
def test_the_network_says_of_a_recorded_decision_what_it_said_then(learner, rolled, phase):
    """So the first gradient step of an update begins at a probability ratio of 1."""
    network = learner.initial().network

    @eqx.filter_jit
    def again(network, transition):
        _, logits, value = ask(network, learner.bank, transition)
        return jax.nn.log_softmax(jnp.where(transition.allowed.any(), logits, 0.0)), value

    transitions = rolled(phase)
    for at in [(0, 0), (1, 1), (5, 0), (7, 1), (16, 0)]:
        one = jax.tree.map(lambda a, at=at: a[at], transitions)
        logs, value = again(network, one)
        assert float(value) == pytest.approx(float(one.value), abs=2e-4)
        if one.stopped:
            assert one.log_probability == 0.0
        else:
            assert float(logs[one.index]) == pytest.approx(float(one.log_probability), abs=2e-4)


@pytest.mark.parametrize("phase", PHASES)
def test_agents_stop_once_each_and_the_last_one_ends_the_mission(rolled, phase):
    transitions = rolled(phase)
    complete = list(missions(transitions))
    assert len(complete) >= MISSIONS
    for events in complete:
        agents = [int(transitions.agent[at]) for at in events]
        stops = [agent for agent, at in zip(agents, events, strict=True) if transitions.stopped[at]]
        assert sorted(stops) == list(range(AGENTS)) and transitions.stopped[events[-1]]
        for agent in range(AGENTS):
            own = [at for at in events if transitions.agent[at] == agent]
            assert [bool(transitions.stopped[at]) for at in own] == [False] * (len(own) - 1) + [True]
            # The budget falls to what allows no further edge, the memory begins empty and changes.
            left = [float(transitions.remaining[at]) for at in own]
            assert all(np.diff(left) < 0)
            assert not transitions.memory.hidden[own[0]].any()
            assert all(transitions.memory.hidden[at].any() for at in own[1:])
    np.testing.assert_array_equal(transitions.stopped, ~transitions.allowed.any(axis=-1))
    # A new mission has its own world and begins at nodes 0, with its whole budget.
    for begin in [(events[-1][0] + 1, events[-1][1]) for events in complete if events[-1][0] + 1 < EVENTS]:
        assert transitions.node[begin] == 0 and 0.6 - 1e-6 <= transitions.remaining[begin] <= 0.8 + 1e-6
        assert not transitions.stopped[begin]
        earlier = begin[0] - 1, begin[1]
        assert (transitions.signs[begin] != transitions.signs[earlier]).any()


@pytest.mark.parametrize("phase", PHASES)
def test_agents_arrive_where_they_chose_to_go(learner, rolled, phase):
    transitions = rolled(phase)
    whole = 0
    distances = np.asarray(learner.bank.roadmap.distances)
    for events in missions(transitions):
        for agent in range(AGENTS):
            own = [at for at in events if transitions.agent[at] == agent]
            for now, then in zip(own[:-1], own[1:], strict=True):
                choice = transitions.index[now]
                assert transitions.allowed[now][choice]
                edge = distances[transitions.roadmap[now], agent, transitions.node[now], choice]
                left = transitions.remaining[now]
                used = left - transitions.remaining[then]
                assert float(used) == pytest.approx(min(float(edge), float(left)), abs=1e-5)
                if edge < left:  # the last leg is cut where the budget ends
                    assert transitions.node[then] == transitions.neighbours[now][choice]
                    whole += 1
    assert whole > 4


def test_the_teacher_s_lesson_is_followed(rolled):
    transitions = rolled("imitate")
    acts = ~transitions.stopped
    np.testing.assert_allclose(transitions.lesson[acts].sum(axis=-1), 1.0, atol=1e-5)
    assert not transitions.lesson[~transitions.allowed].any() and not transitions.lesson[~acts].any()
    followed = np.take_along_axis(transitions.lesson, transitions.index[..., None], axis=-1)[..., 0][acts]
    # Drawn from the lesson, a choice has the mean probability sum p^2; drawn from anything flat, about 1 / 20.
    expected = (transitions.lesson[acts] ** 2).sum(axis=-1)
    assert (followed > 1e-6).all() and followed.mean() == pytest.approx(expected.mean(), abs=0.15)
    assert expected.mean() > 0.3


def test_the_search_s_best_path_is_followed(rolled):
    transitions = rolled("search")
    acts = ~transitions.stopped
    np.testing.assert_array_equal(transitions.index[acts], transitions.elites.index[acts][:, 0, 0])
    expected = np.eye(transitions.lesson.shape[-1])[transitions.elites.index[..., 0, 0]] * acts[..., None]
    np.testing.assert_array_equal(transitions.lesson, expected)


def test_whoever_follows_nobody_goes_where_the_policy_says(rolled):
    """The same key draws the same choices as where there is nobody to follow."""
    imitated, reinforced = rolled("imitate", 0.0), rolled("reinforce", 0.0)
    for name in ("index", "agent", "node", "stopped", "ended"):
        np.testing.assert_array_equal(getattr(imitated, name), getattr(reinforced, name))
    assert not reinforced.lesson.any() and reinforced.elites is None
    assert imitated.lesson.any() and (rolled("imitate", 1.0).index != imitated.index).any()


def test_a_choice_is_drawn_from_the_lesson_as_often_as_follow_says(learner, environments, monkeypatch):
    """512 draws of one decision with a made-up lesson: a quarter for the first neighbour, the rest for the third.

    Half of them follow it. The policy's own share of these two is known, so both counts are binomial.
    """
    draws = 512
    environment: RolloutState = jax.tree.map(lambda a: a[0], environments)
    choice = jnp.zeros(learner.scenario.neighbours).at[0].set(0.25).at[2].set(0.75)
    monkeypatch.setattr(rollout, "teach", lambda *args: Lesson(choice, jnp.arange(4.0)))
    planner = learner.planner(learner.initial().network, "imitate")

    @eqx.filter_jit
    def run(keys):
        def one(key):
            after, transition = step(
                CONFIG, learner.scenario, planner, learner.bank, environment, key, "imitate", jnp.float32(0.5)
            )
            logits = ask(planner.sampler.policy, learner.bank, transition)[1]
            return transition.index, jax.nn.softmax(logits), after.plans, after.state.leg

        return jax.vmap(one)(keys)

    index, policy, plans, legs = jax.tree.map(np.asarray, run(jax.random.split(jax.random.key(0), draws)))
    assert (policy[0] > 0).all()
    for neighbour, share in ((0, 0.25), (2, 0.75), (1, 0.0)):
        chance = 0.5 * share + 0.5 * policy[0, neighbour]
        deviation = np.sqrt(draws * chance * (1 - chance))
        assert abs(np.sum(index == neighbour) - draws * chance) < 4.5 * deviation
    # The plan is kept for the agent that decided, agent 0, alone; it travels to the node that was taken.
    np.testing.assert_array_equal(plans[:, 0], np.tile(np.arange(4.0), (draws, 1)))
    assert not plans[:, 1].any()
    roadmap = jax.tree.map(lambda a: np.asarray(a[environment.world.roadmap, 0]), learner.bank.roadmap)
    gone = np.linalg.norm(legs[:, 0, 1] - legs[:, 0, 0], axis=-1)
    np.testing.assert_allclose(gone, roadmap.distances[0][index], atol=1e-6)


def test_the_trace_is_that_of_the_agent_s_own_belief(learner, environments):
    """Against a posterior from the bare formula, over the measurements that the agent knows when it decides.

    With a threshold of 0.9 the area leaves out what lies around the first measurements already.
    """
    scenario, planner = learner.scenario, learner.planner(learner.initial().network)
    environment: RolloutState = jax.tree.map(lambda a: a[0], environments)
    params = dataclasses.replace(environment.world.params, threshold=jnp.float32(0.9))
    environment = environment._replace(world=environment.world._replace(params=params))

    @eqx.filter_jit
    def decide(environment, key):
        mission = mission_of(learner.config, learner.bank, environment.world)
        observation = begin_event(mission, environment.state)[2]
        after, transition = step(CONFIG, scenario, planner, learner.bank, environment, key, "reinforce", 0.0)
        return after, transition.trace, observation, mission.grid

    def covariance(a, b):
        r = np.sqrt(3) * np.linalg.norm(a[:, None] - b[None], axis=-1) / scenario.length_scale
        return scenario.signal_variance * (1 + r) * np.exp(-r)

    traces = []
    for event in range(5):
        environment, trace, seen, grid = decide(environment, jax.random.key(event))
        known = np.asarray(seen.known)
        x, y, grid = (np.asarray(a, float) for a in (seen.measurement_x[known], seen.measurement_y[known], grid))
        gain = np.linalg.solve(covariance(x, x) + scenario.noise * np.eye(len(x)), covariance(x, grid)).T
        variance = scenario.signal_variance - np.sum(gain * covariance(grid, x), axis=1)
        area = gain @ y + scenario.beta * np.sqrt(variance.clip(0)) >= 0.9
        assert float(trace) == pytest.approx(variance[area].sum(), rel=1e-3)
        traces.append(float(trace))
    assert variance[area].sum() < 0.97 * variance.sum()
    assert scenario.interest_rule == "std" and traces[0] == pytest.approx(900.0) and traces[-1] < 800.0
    assert known.any()
