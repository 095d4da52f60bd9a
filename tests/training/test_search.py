"""Learning from one's own search: which paths are the best, how likely they are, and that they become likelier."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from maipp.engine.observe import begin_event
from maipp.errors import InputError
from maipp.policy import load_policy
from maipp.training.config import NAMED, TrainConfig
from maipp.training.learner import Learner, _schedule
from maipp.training.losses import PolicyExample, sample_loss
from maipp.training.rollout import roll_out
from maipp.training.search import find_elites, surprise
from maipp.training.worlds import agent_roadmap, mission_of

CONFIG = TrainConfig(
    agents=2, budget=(0.6, 0.8), bank=2, shards=1, missions=2, events=6, epochs=1, minibatch=12, paths=2, steps=3,
    imitation=0, search=2, search_paths=6, elites=2, updates=2, learning_rate=1e-3,
)  # fmt: skip


@pytest.fixture(scope="module")
def learner():
    return Learner(CONFIG, jax.devices()[:1])


@pytest.fixture(scope="module")
def searched(learner):
    """The network, and decisions with their elites, leading axes (events, missions)."""
    state = learner.initial()
    planner = learner.planner(state.network, "search")
    environments = jax.tree.map(lambda a: a[0], state.shards.environments)

    @eqx.filter_jit
    def run(planner, environments):
        key = jax.random.key(3)
        return roll_out(CONFIG, learner.scenario, planner, learner.bank, environments, key, "search", 0.7)[1]

    return planner, run(planner, environments)


def test_elites_walk_along_edges_and_see_less_uncertainty_behind_them(learner, searched):
    _, transitions = searched
    elites = jax.tree.map(np.asarray, transitions.elites)
    assert elites.index.shape == (6, 2, 2, 3) and elites.taken.any() and not elites.taken.all()
    roadmaps = learner.bank.roadmap
    for event, mission in np.ndindex(6, 2):
        row, agent = int(transitions.roadmap[event, mission]), int(transitions.agent[event, mission])
        neighbours = np.asarray(roadmaps.neighbours[row, agent])
        distances = np.asarray(roadmaps.distances[row, agent])
        for path in range(2):
            one = jax.tree.map(lambda a, at=(event, mission, path): a[at], elites)
            here, left = int(transitions.node[event, mission]), float(transitions.remaining[event, mission])
            for t in range(3):
                assert one.node[t] == here and one.remaining[t] == pytest.approx(left, abs=1e-5)
                np.testing.assert_array_equal(one.neighbours[t], neighbours[here])
                if not one.taken[t]:
                    assert not one.taken[t:].any()
                    break
                assert one.allowed[t, one.index[t]]
                left, here = left - distances[here, one.index[t]], int(neighbours[here, one.index[t]])
        first = elites.neighbour_std[event, mission, :, 0]
        np.testing.assert_allclose(first, np.tile(transitions.neighbour_std[event, mission], (2, 1)), atol=1e-5)


def test_the_best_path_leaves_the_lowest_trace_of_all_sampled(learner, searched):
    """One decision anew: the planner's own paths and scores, sorted."""
    planner, _ = searched
    state = learner.initial()
    environment = jax.tree.map(lambda a: a[0, 0], state.shards.environments)

    @eqx.filter_jit
    def decide(planner, environment):
        mission = mission_of(learner.config, learner.bank, environment.world)
        after, agent, observation = begin_event(mission, environment.state)
        roadmap = agent_roadmap(learner.bank, environment.world, agent)
        observation = dataclasses.replace(observation, roadmap=roadmap)
        memory = jax.tree.map(lambda a: a[agent], after.memory)
        _, choice = planner.act(jax.random.key(1), observation, memory)
        elites = find_elites(CONFIG, planner, jax.random.key(2), observation, choice)
        return choice.paths.nodes, choice.scores, elites

    nodes, scores, elites = jax.tree.map(np.asarray, decide(planner, environment))
    order = np.argsort(scores, kind="stable")[:2]
    np.testing.assert_array_equal(elites.node[:, 1:], nodes[order][:, :-1])


def test_surprise_is_minus_the_log_probability_of_the_steps(learner, searched):
    """Step by step, by the softmax of the decoder's logits."""
    planner, transitions = searched
    network = planner.sampler.policy

    @eqx.filter_jit
    def both(network, transition):
        encoding = learner.bank.roadmap.encoding[transition.roadmap, transition.agent] * transition.signs
        prepared = network.prepare(network.encode(transition.features, encoding))
        whole = surprise(network, prepared, transition.memory, transition.threshold, transition.elites)
        parts = jnp.float32(0.0)
        for path in range(2):
            memory = transition.memory
            for t in range(3):
                at = jax.tree.map(lambda a, at=(path, t): a[at], transition.elites)
                view = (at.node, at.neighbours, at.allowed, at.neighbour_std, at.remaining)
                logits, _, memory = network.decode(prepared, *view, transition.threshold, memory)
                chances = jax.nn.softmax(jnp.where(at.allowed.any(), logits, 0.0))
                parts += jnp.where(at.taken, -jnp.log(chances[at.index]), 0.0)
        return whole, parts / 2

    for event, mission in ((0, 0), (2, 1), (5, 0)):
        whole, parts = both(network, jax.tree.map(lambda a, at=(event, mission): a[at], transitions))
        assert float(whole) == pytest.approx(float(parts), rel=1e-4, abs=1e-5)


def test_gradient_steps_make_the_elites_likelier(learner, searched):
    planner, transitions = searched
    flat = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), transitions)
    count = flat.index.shape[0]
    samples = PolicyExample(flat, jnp.zeros(count), jnp.zeros(count), jnp.zeros(count, bool))

    @eqx.filter_jit
    def loss(network):
        return jnp.mean(jax.vmap(lambda s: sample_loss(CONFIG, network, learner.bank, s, "search")[0])(samples))

    before, gradient = eqx.filter_jit(eqx.filter_value_and_grad(loss))(planner.sampler.policy)
    size = optax.tree.norm(gradient)
    moved = jax.tree.map(lambda w, g: w - 0.02 * g / size, planner.sampler.policy, gradient)
    assert loss(moved) < before


def test_a_run_may_start_from_weights_of_its_own_kind():
    with pytest.raises(InputError, match="start: sga-catnipp is not for policy ti"):
        Learner(CONFIG.replace(start="sga-catnipp"), jax.devices()[:1])
    with pytest.raises(InputError, match="weights 'nobody'"):
        Learner(CONFIG.replace(start="nobody"), jax.devices()[:1])
    started = Learner(CONFIG.replace(start="ti"), jax.devices()[:1])
    for a, b in zip(*map(jax.tree.leaves, (started.initial().network, load_policy("ti"))), strict=True):
        np.testing.assert_array_equal(a, b)


def test_elites_are_some_of_the_paths():
    with pytest.raises(InputError, match="elites: 9; give at most search_paths, 4"):
        TrainConfig(search_paths=4, elites=9)


def test_a_run_imitates_then_reinforces_then_searches():
    config = TrainConfig(imitation=2, search=3, updates=9, learning_rate=1e-3, search_rate=5e-4)
    learner = Learner(config.replace(bank=1), jax.devices()[:1])
    phases = [learner._phase(updates) for updates in range(9)]
    assert phases == ["imitate"] * 2 + ["reinforce"] * 4 + ["search"] * 3
    schedule, per_update = _schedule(config), config.epochs * config.minibatches
    rates = [float(jnp.asarray(schedule(step))) for step in (0, 6 * per_update - 1, 6 * per_update, 9 * per_update)]
    assert rates[0] == pytest.approx(1e-3) and rates[1] < 1e-4
    assert rates[2] == pytest.approx(5e-4) and rates[3] == pytest.approx(1e-5)
    paper = NAMED["paper"]  # once per training step, of which each has eight of Adam's
    schedule, per_update = _schedule(paper), paper.epochs * paper.minibatches
    assert per_update == 8 and paper.transitions_per_update == 512
    for update in (0, 31, 32, 600, 3999):
        rate = float(jnp.asarray(schedule(update * per_update)))
        assert rate == pytest.approx(5e-5 * 0.96 ** (update // 32), rel=1e-4)
    with pytest.raises(InputError, match=r"updates: 4; give at least imitation \+ search, 5"):
        config.replace(updates=4)
