"""The learner: advantages normalised over all shards, a bandit that PPO must solve, and what each phase tells."""

from pathlib import Path
from typing import Any, get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maipp.policy import PolicyNetwork
from maipp.roadmap import Roadmap
from maipp.training import learner as module
from maipp.training.config import TrainConfig
from maipp.training.learner import Learner, Shard, TrainState, normalise
from maipp.training.losses import ask
from maipp.training.rollout import Phase, Transition
from maipp.training.worlds import Bank

PAGE = (Path(__file__).parents[2] / "docs" / "training.md").read_text(encoding="utf-8")

# Two devices with two shards each, four decisions of three missions.
normalised = jax.jit(jax.vmap(jax.vmap(normalise, axis_name="shards"), axis_name="devices"))
SHAPE = (2, 2, 4, 3)


@given(arrays(np.float32, SHAPE, elements=st.floats(-5, 5, width=32)), arrays(bool, SHAPE))
def test_advantages_have_zero_mean_and_unit_variance_over_all_valid_ones(advantage, valid):
    got = np.asarray(normalised(advantage, valid), float)
    assert (got[~valid] == 0).all() and np.isfinite(got).all()
    told = advantage[valid].astype(float)
    if len(told) and told.std() > 0.05:
        assert got[valid].mean() == pytest.approx(0.0, abs=1e-3) and got[valid].std() == pytest.approx(1.0, rel=1e-3)
        np.testing.assert_allclose(got[valid], (told - told.mean()) / told.std(), atol=1e-3)


def test_advantages_that_are_all_alike_say_nothing():
    """The mean of equal ones is off by a rounding, 5e-7 of 5, which the 1e-8 beside the variance lets grow 1e4-fold."""
    for value in (0.0, 5.0, -3.3):
        got = normalised(np.full(SHAPE, value, np.float32), np.ones(SHAPE, bool))
        np.testing.assert_allclose(got, np.zeros(SHAPE), atol=2e-2)


def test_whatever_invalid_advantages_hold_they_change_nothing():
    advantage, valid = np.random.default_rng(0).normal(size=(2, *SHAPE)).astype(np.float32)
    valid = valid > 0
    other = np.where(valid, advantage, 1e6).astype(np.float32)
    np.testing.assert_array_equal(normalised(advantage, valid), normalised(other, valid))


BANDIT = TrainConfig(
    agents=2, bank=1, shards=2, missions=8, events=4, epochs=2, minibatch=16, imitation=0, search=0, updates=30,
    learning_rate=5e-3, schedule="constant",
)  # fmt: skip
ARMS, ENCODINGS = 2, 4
RIGHT = jnp.array([1, 0])  # the arm that agent 0, and agent 1, should pull


def two_nodes(agent):
    """What an agent is shown: two nodes that only their features tell apart, and the agents as well."""
    features = jnp.array([[0.3, 0.0, 0.0, 0.5, 0.0], [-0.3, 0.0, 1.0, 0.5, 0.0]])
    return features + jnp.where(agent == 0, 0.0, 1.0) * jnp.array([0.0, 0.5, 0.0, 0.0, 1.0])


def decision(agent, memory, *, trace, stopped=False, ended=False):
    """A decision, index, log-probability and value to be filled in."""
    zero = jnp.int32(0)
    unread: dict[str, Any] = dict.fromkeys(Transition._fields)
    shown = {
        "features": two_nodes(agent),
        "roadmap": zero,
        "agent": jnp.int32(agent),
        "signs": jnp.ones(ENCODINGS),
        "node": zero,
        "neighbours": jnp.arange(ARMS),
        "allowed": jnp.full(ARMS, not stopped),
        "neighbour_std": jnp.full(ARMS, 0.5),
        "remaining": jnp.float32(0.0 if stopped else 1.0),
        "threshold": jnp.float32(0.4),
        "memory": memory,
        "lesson": jnp.zeros(ARMS),
        "index": zero,
        "log_probability": jnp.float32(0.0),
        "value": jnp.float32(0.0),
        "trace": jnp.asarray(trace, jnp.float32),
        "stopped": jnp.asarray(stopped),
        "ended": jnp.asarray(ended),
    }
    return Transition(**unread | shown)


def pull(config, scenario, planner, bank, environments, key, phase, follow):
    """In place of the survey: both agents pull an arm, then both find what Tr(P) their own arm left, and stop.

    The right arm leaves 60 of 100, the wrong one 90. Agent 1 pulls before agent 0 learns what came of its arm: whoever
    takes the next decision in the stream for the same agent's learns nothing.
    """
    network = planner.sampler.policy
    memory = network.initial_memory()

    def mission(key):
        events = []
        for agent in (0, 1):
            first = decision(agent, memory, trace=100.0)
            _, logits, value = ask(network, bank, first)
            index = jax.random.categorical(jax.random.fold_in(key, agent), logits).astype(jnp.int32)
            events.append(first._replace(index=index, log_probability=jax.nn.log_softmax(logits)[index], value=value))
        for agent in (0, 1):
            left = jnp.where(events[agent].index == RIGHT[agent], 60.0, 90.0)
            events.append(decision(agent, memory, trace=left, stopped=True, ended=agent == 1))
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *events)

    return environments, jax.vmap(mission, out_axes=1)(jax.random.split(key, config.missions))


def test_ppo_solves_a_bandit(monkeypatch):
    """The real returns, losses, minibatches and optimiser, in the real update; only the survey is a made-up one."""
    monkeypatch.setattr(module, "roll_out", pull)
    learner = Learner(BANDIT, jax.devices()[:1])
    edges = jnp.zeros((1, 2, ARMS, ARMS), jnp.int32), jnp.zeros((1, 2, ARMS, ARMS)), jnp.ones((1, 2, ARMS, ARMS), bool)
    encoding = jnp.zeros((1, 2, ARMS, ENCODINGS))
    learner.bank = Bank(Roadmap(jnp.zeros((1, 2, ARMS, 2)), *edges, encoding), jnp.zeros((1, 2, 2)))
    network = PolicyNetwork(jax.random.key(1), width=16, heads=2, encoding_dimensions=ENCODINGS)
    keys = jax.random.split(jax.random.key(2), BANDIT.shards)
    environments: Any = jnp.zeros((BANDIT.shards, BANDIT.missions))  # of which nothing is needed
    weights: Any = network
    state = TrainState(network, learner._optimiser.init(weights), Shard(environments, keys), jnp.int32(0))

    @jax.jit
    def chances(network):
        def of(agent):
            return jax.nn.softmax(ask(network, learner.bank, decision(agent, network.initial_memory(), trace=1.0))[1])

        return jnp.stack([of(agent)[RIGHT[agent]] for agent in (0, 1)])

    before = np.asarray(chances(state.network))
    assert (before > 0.2).all() and (before < 0.8).all()
    metrics = []
    for _ in range(BANDIT.updates):
        state, told = learner.update(state)
        metrics.append({name: float(value) for name, value in told.items()})
    assert (np.asarray(chances(state.network)) > 0.9).all()
    assert metrics[-1]["final_trace"] < 70 < metrics[0]["final_trace"]  # of the last agent to stop
    assert metrics[0]["missions_ended"] == BANDIT.shards * BANDIT.missions
    assert metrics[-1]["value_loss"] < 0.1 * metrics[0]["value_loss"] or metrics[-1]["value_loss"] < 1e-2
    assert metrics[-1]["entropy"] < metrics[0]["entropy"]
    # Of the decisions half are choices; the others count for nothing.
    assert all(one["kl"] > -1e-6 and 0 <= one["clip_fraction"] <= 0.5 for one in metrics)
    assert max(one["clip_fraction"] for one in metrics) > 0


def test_the_log_of_each_phase_has_what_means_something_in_it():
    """Traced, not run: the numbers of an update in each phase are those that docs/training.md lists for it."""
    config = TrainConfig(
        agents=2, budget=(0.6, 0.8), bank=1, shards=1, missions=2, events=2, epochs=1, minibatch=4, paths=2, steps=2,
        imitation=1, search=1, search_paths=4, elites=2, updates=3,
    )  # fmt: skip
    learner = Learner(config, jax.devices()[:1])
    state = learner.initial()
    told = {phase: set(learner._update[phase].eval_shape(state, learner.bank)[1]) for phase in get_args(Phase)}
    ppo = {"policy_loss", "kl", "clip_fraction"}
    always = {"loss", "value_loss", "entropy", "gradient_norm", "learning_rate", "missions_ended", "final_trace"}
    assert told == {
        "imitate": always | {"imitation_loss"},
        "reinforce": always | ppo,
        "search": always | {"imitation_loss"},
    }
    log = PAGE[PAGE.index("A line of an update has") : PAGE.index("A line of an evaluation has")]
    rows = {line.split("|")[1]: line for line in log.splitlines() if line.startswith("| `")}
    for name in set().union(*told.values()):
        (row,) = [line for keys, line in rows.items() if f"`{name}`" in keys]
        assert ("reinforcement only" in row) == (name in ppo)
        assert ("imitation and search only" in row) == (name == "imitation_loss")
