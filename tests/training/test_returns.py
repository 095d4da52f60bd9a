"""Rewards, advantages and returns: worked out by hand, and against the definition of the lambda-return."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.training.config import TrainConfig
from maipp.training.returns import Returns, final_reward, returns, reward
from maipp.training.rollout import Transition

CONFIG = TrainConfig(discount=0.5, trace_decay=0.8)
PAPER = CONFIG.replace(reward="paper")


class Event(NamedTuple):
    """What the returns need of one decision."""

    agent: int
    trace: float
    value: float
    stopped: bool = False
    ended: bool = False


def transitions(*missions: list[Event]) -> Transition:
    """The events of missions stepped side by side, as the sampling gives them: leading axes (events, missions)."""
    kinds = {"agent": np.int32, "trace": np.float32, "value": np.float32, "stopped": bool, "ended": bool}
    columns: dict[str, Any] = {
        n: jnp.asarray(np.array([[getattr(e, n) for e in m] for m in missions], t).T) for n, t in kinds.items()
    }
    unread: dict[str, Any] = dict.fromkeys(Transition._fields)
    return Transition(**unread | columns)


compiled = jax.jit(returns, static_argnums=(0, 2))


# Two agents and two missions in one stream of decisions, which two batches cut in the midst of the second mission.
FIRST = [
    Event(0, 8.0, 1.0),
    Event(1, 8.0, 2.0),
    Event(0, 4.0, 3.0),
    Event(1, 4.0, 0.5, stopped=True),
    Event(0, 2.0, 2.0),
    Event(0, 1.0, 0.25, stopped=True, ended=True),
    # another mission
    Event(0, 16.0, 5.0),
    Event(1, 16.0, 6.0),
    Event(0, 8.0, 7.0),
    Event(1, 4.0, 1.0),
]
SECOND = [
    Event(1, 2.0, 3.0),
    Event(0, 2.0, 4.0, stopped=True),
    Event(1, 1.0, 2.0, stopped=True, ended=True),
]
# Whoever has nowhere to go chose nothing; the outcome of each agent's last decision lies in the next batch.
VALID = [True, True, True, False, True, False, True, True, False, False]


def test_by_hand_with_the_papers_reward():
    """Discount 0.5, lambda 0.8, their product 0.4; reward (before - after) / before; for the end -0.02 Tr(P)."""
    got = returns(PAPER, transitions(FIRST), 2)
    advantage = np.zeros(10)
    # The first mission, backwards. Agent 0: from 2 to 1, then the end, worth -0.02 * 1.
    advantage[4] = (2 - 1) / 2 + 0.5 * (-0.02 * 1) - 2.0  # -1.51
    advantage[2] = (4 - 2) / 4 + 0.5 * 2.0 - 3.0 + 0.4 * -1.51  # -2.104
    advantage[0] = (8 - 4) / 8 + 0.5 * 3.0 - 1.0 + 0.4 * -2.104  # 0.1584
    # Agent 1: from 8 to 4, then the end, worth -0.02 * 4.
    advantage[1] = (8 - 4) / 8 + 0.5 * (-0.02 * 4) - 2.0  # -1.54
    # The second mission goes on after the batch: the value of each agent's last decision stands for what follows.
    advantage[6] = (16 - 8) / 16 + 0.5 * 7.0 - 5.0  # -1
    advantage[7] = (16 - 4) / 16 + 0.5 * 1.0 - 6.0  # -4.75
    np.testing.assert_allclose(advantage, [0.1584, -1.54, -2.104, 0, -1.51, 0, -1, -4.75, 0, 0])
    np.testing.assert_array_equal(got.valid[:, 0], VALID)
    np.testing.assert_allclose(got.advantage[:, 0], advantage, atol=1e-6)
    target = np.array([e.value for e in FIRST]) + advantage
    np.testing.assert_allclose(got.target[:, 0][got.valid[:, 0]], target[VALID], atol=1e-6)
    # The next batch knows nothing of the one before.
    got = returns(PAPER, transitions(SECOND), 2)
    np.testing.assert_array_equal(got.valid[:, 0], [True, False, False])
    np.testing.assert_allclose(got.advantage[0, 0], (2 - 1) / 2 + 0.5 * (-0.02 * 1) - 3.0, atol=1e-6)  # -2.51
    np.testing.assert_allclose(got.target[0, 0], 0.49, atol=1e-6)


def test_by_hand_with_the_log_trace():
    """The same stream: each halving of the trace is worth log 2, and the end nothing."""
    got = returns(CONFIG, transitions(FIRST, [Event(1, 900.0, 9.0)] * 10), 2)
    halving = np.log(2.0)
    advantage = np.zeros(10)
    advantage[4] = halving + 0.5 * 0.0 - 2.0
    advantage[2] = halving + 0.5 * 2.0 - 3.0 + 0.4 * advantage[4]
    advantage[0] = halving + 0.5 * 3.0 - 1.0 + 0.4 * advantage[2]
    advantage[1] = halving + 0.5 * 0.0 - 2.0
    advantage[6] = halving + 0.5 * 7.0 - 5.0
    advantage[7] = 2 * halving + 0.5 * 1.0 - 6.0
    np.testing.assert_array_equal(got.valid[:, 0], VALID)  # whatever is stepped beside it
    np.testing.assert_allclose(got.advantage[:, 0], advantage, atol=1e-6)


def test_rewards():
    before, after = jnp.array([8.0, 4.0, 4.0, 0.0]), jnp.array([2.0, 4.0, 8.0, 0.0])
    np.testing.assert_allclose(reward(CONFIG.reward, before, after), np.log([4.0, 1.0, 0.5, 1.0]), atol=1e-6)
    np.testing.assert_allclose(reward(PAPER.reward, before, after), [0.75, 0.0, -1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(final_reward(PAPER.reward, before), [-0.16, -0.08, -0.08, 0.0], atol=1e-7)
    np.testing.assert_array_equal(final_reward(CONFIG.reward, before), np.zeros(4))
    assert float(reward(CONFIG.reward, jnp.float32(1.0), jnp.float32(0.0))) == pytest.approx(np.log(1e3), rel=1e-5)


def test_undiscounted_log_trace_rewards_sum_to_that_of_the_whole_mission():
    """With no value, no discount and lambda 1 the advantage of the first decision is the whole mission's fall."""
    config = CONFIG.replace(discount=1.0, trace_decay=1.0)
    stream = [Event(0, trace, 0.0) for trace in (900.0, 500.0, 33.0)] + [Event(0, 7.0, 0.0, True, True)]
    assert float(returns(config, transitions(stream), 1).advantage[0, 0]) == pytest.approx(np.log(900 / 7), rel=1e-5)


def lambda_return(config, traces, values, complete):
    """Of the decisions of one agent in one mission, by the definition (Sutton and Barto 2018, eq. 12.3), in float64.

    `complete`: the last one is the end. NaN for the last decision, which is the end or whose outcome is not known.
    """
    gamma, decay = config.discount, config.trace_decay
    ahead = np.array(values, float)
    if complete:
        ahead[-1] = -0.02 * traces[-1] if config.reward == "paper" else 0.0
    if config.reward == "paper":
        rewards = [(a - b) / a for a, b in zip(traces[:-1], traces[1:], strict=True)]
    else:
        rewards = [np.log(a / b) for a, b in zip(traces[:-1], traces[1:], strict=True)]
    last, result = len(traces) - 1, np.full(len(traces), np.nan)
    for t in range(last):
        total, steps = 0.0, last - t
        for n in range(1, steps + 1):
            n_step = sum(gamma**i * rewards[t + i] for i in range(n)) + gamma**n * ahead[t + n]
            weight = (1 - decay) * decay ** (n - 1) if n < steps else decay ** (steps - 1)
            total += weight * n_step
        result[t] = total
    return result


def reference(config: TrainConfig, stream: list[Event], agents: int) -> np.ndarray:
    """The lambda-return of every event of a stream; NaN where there is none."""
    result, begin = np.full(len(stream), np.nan), 0
    ends = [i + 1 for i, event in enumerate(stream) if event.ended]
    for end in [*ends, len(stream)]:
        for agent in range(agents):
            own = [i for i in range(begin, end) if stream[i].agent == agent]
            if own:
                traces, values = ([getattr(stream[i], name) for i in own] for name in ("trace", "value"))
                result[own] = lambda_return(config, traces, values, stream[own[-1]].stopped)
        begin = end
    return result


@st.composite
def streams(draw, agents):
    """Twelve decisions of missions one after the other: each agent decides until it stops, in any order.

    Now and then the engine ends an agent that did not stop by itself: its record is full.
    """
    stream, left = [], set(range(agents))
    for _ in range(12):
        agent = draw(st.sampled_from(sorted(left)))
        fate = draw(st.sampled_from(["on", "on", "stopped", "full"]))
        left -= set() if fate == "on" else {agent}
        number = st.floats(-3, 3, width=32)
        stream.append(Event(agent, draw(st.floats(0.5, 900, width=32)), draw(number), fate == "stopped", not left))
        left = left or set(range(agents))
    return stream


CONFIGS = [
    TrainConfig(reward=kind, discount=discount, trace_decay=decay)
    for kind in ("paper", "log-trace")
    for discount, decay in ((0.9, 0.7), (1.0, 0.95), (0.99, 0.0))
]


@pytest.mark.parametrize("agents", [1, 3])
@given(data=st.data())
def test_advantages_are_lambda_returns_less_the_value(agents, data):
    pair = [data.draw(streams(agents)), data.draw(streams(agents))]
    told = transitions(*pair)
    for config in CONFIGS:
        got: Returns = jax.tree.map(np.asarray, compiled(config, told, agents))
        for column, stream in enumerate(pair):
            expected = reference(config, stream, agents)
            valid = got.valid[:, column]
            np.testing.assert_array_equal(valid, ~np.isnan(expected))
            value = np.array([event.value for event in stream])
            # Traces fall and rise 1800-fold: the paper's reward is as low as -1800, of which float32 keeps six digits.
            scale = max(1.0, np.abs(expected[valid]).max(initial=0.0))
            np.testing.assert_allclose(got.target[valid, column], expected[valid], atol=5e-6 * scale)
            np.testing.assert_allclose(got.advantage[valid, column], (expected - value)[valid], atol=5e-6 * scale)
            np.testing.assert_array_equal(got.advantage[~valid, column], 0.0)
