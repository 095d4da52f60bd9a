"""The laws of the turns: who decides when, what it sees then, and what it is given for its last decision."""

import math
from typing import Any

import jax
import numpy as np
import pytest

pytest.importorskip("pettingzoo")

import maipp  # noqa: E402
import maipp.adapters.pettingzoo as environments  # noqa: E402
from maipp import Scenario  # noqa: E402

surveys: Any = environments  # its observations are arrays or dictionaries, by the options
SMALL = Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)
# Unequal robots that seldom hear each other: what is known, and who is due when, depends on the order of events.
UNEQUAL = SMALL.replace(budget=(1.2, 0.9, 1.1), speed=(1.0, 0.7, 1.3), comm_range=0.3, last_leg="stop")


def play_aec(env, seed, choose):
    """Run a survey to its end; how many steps each agent took, and its reward."""
    env.reset(seed=seed)
    total = dict.fromkeys(env.possible_agents, 0.0)
    for agent in env.agent_iter():
        observation, reward, terminated, truncated, _ = env.last()
        total[agent] += reward
        env.step(None if terminated or truncated else choose(env, agent, observation))
    return total


def play_parallel(env, seed, choose):
    observations, infos = env.reset(seed=seed)
    total = dict.fromkeys(env.possible_agents, 0.0)
    while env.agents:
        actions = {
            name: env.scenario.neighbours if infos[name]["travelling"] else choose(env, name, observations[name])
            for name in env.agents
        }
        observations, rewards, *_, infos = env.step(actions)
        for name, reward in rewards.items():
            total[name] += reward
    return total


def widest(env, agent, observation):
    """The allowed neighbour that the agent knows least of."""
    std = surveys.split_view(env.scenario, observation["observation"]).candidates[:, 4]
    return int(np.argmax(np.where(observation["action_mask"][: len(std)] == 1, std, -1)))


@pytest.mark.parametrize("reward", ["paper", "log-trace"])
def test_rewards_are_those_of_the_trace_between_an_agent_s_decisions(reward):
    env = surveys.aec_env(SMALL, reward=reward)
    env.reset(seed=2)
    traces = {name: [] for name in env.possible_agents}
    total = dict.fromkeys(env.possible_agents, 0.0)
    for agent in env.agent_iter():
        observation, gained, terminated, _, info = env.last()
        traces[agent].append(info["trace"])
        total[agent] += gained
        env.step(None if terminated else widest(env, agent, observation))
    for agent, seen in traces.items():
        assert seen[0] == pytest.approx(64.0, rel=1e-3) and len(seen) > 3  # the prior, on 8 x 8 points
        if reward == "log-trace":
            worth = math.log(seen[0]) - math.log(seen[-1])
        else:
            worth = sum((a - b) / a for a, b in zip(seen, seen[1:], strict=False)) - 0.02 * seen[-1]
        assert total[agent] == pytest.approx(worth, rel=1e-4)


def test_both_environments_give_an_agent_alone_the_same_rewards():
    alone = SMALL.replace(agents=1)
    one = play_aec(surveys.aec_env(alone), 3, widest)
    other = play_parallel(surveys.parallel_env(alone), 3, widest)
    assert one["robot_0"] == pytest.approx(other["robot_0"], abs=1e-5) and one["robot_0"] != 0


def test_the_mask_allows_what_the_budget_does():
    env = surveys.aec_env(UNEQUAL)
    env.reset(seed=4)
    checked = 0
    for agent in env.agent_iter():
        observation, _, terminated, _, info = env.last()
        lengths = surveys.split_view(UNEQUAL, observation["observation"]).candidates[:, 2]
        if not terminated:
            fits = (lengths <= info["remaining"] + 1e-5) & (lengths > 1e-5)
            assert (observation["action_mask"] == fits).all()
            checked += 1
        assert all(env.observe(name)["action_mask"].sum() == 0 for name in env.agents if name != agent)
        env.step(None if terminated else widest(env, agent, observation))
    assert checked > 6


def test_who_travels_may_only_wait_and_is_not_asked():
    env = surveys.parallel_env(SMALL)
    observations, infos = env.reset(seed=6)
    waited = 0
    while env.agents:
        actions = {}
        for name in env.agents:
            mask = observations[name]["action_mask"]
            if infos[name]["travelling"]:
                assert mask.tolist() == [0, 0, 0, 0, 1]
                waited += 1
                actions[name] = "no action at all"
            else:
                assert mask[-1] == 0 and mask.any()
                actions[name] = widest(env, name, observations[name])
        observations, *_, infos = env.step(actions)
    assert waited > 3


def test_agents_hear_where_the_others_are_going():
    env = surveys.aec_env(SMALL)
    env.reset(seed=7)
    first, second = env.possible_agents[:2]
    parts = surveys.split_view(SMALL, env.last()[0]["observation"])
    place = parts.own[:2] + parts.candidates[0, :2]
    env.step(0)
    assert env.agent_selection == second
    heard = surveys.split_view(SMALL, env.last()[0]["observation"])
    told = heard.team[-1]  # the first agent is the last of the others when counted from the second on
    assert told[0] == told[3] == 1
    np.testing.assert_allclose(heard.own[:2] + told[4:], place, atol=1e-6)
    assert heard.team[0, 3] == 0  # the third has told nothing yet
    distance = np.linalg.norm(heard.own[:2] + heard.candidates[:, :2] - place, axis=1)
    np.testing.assert_allclose(heard.candidates[:, 7], np.exp(-(distance**2) / 0.08), atol=1e-4)


def test_a_seed_gives_the_simulator_s_world_and_those_that_follow():
    env, other = surveys.aec_env(SMALL), surveys.parallel_env(SMALL)
    missions = maipp.draw_missions(SMALL, seed=11, instances=1)
    env.reset(seed=11)
    other.reset(seed=11)
    np.testing.assert_array_equal(env.simulator_state()[0].truth, missions.truth)
    env.reset()
    other.reset()
    following = env.simulator_state()[0].truth
    assert not np.array_equal(following, missions.truth)
    np.testing.assert_array_equal(following, other.simulator_state()[0].truth)


def test_environments_whose_scenarios_differ_in_numbers_share_what_is_compiled():
    env, same = surveys.aec_env(SMALL), surveys.aec_env(Scenario.from_dict(SMALL.to_dict()), max_cycles=3)
    other = surveys.aec_env(SMALL.replace(threshold=0.3))
    for each in (env, same, other):
        play_aec(each, 1, widest)
    assert env._calls is same._calls is other._calls
    assert env._calls.play._cache_size() == env._calls.first._cache_size() == 1
    rewarded = surveys.aec_env(SMALL, reward="log-trace")
    rewarded.reset(seed=1)
    assert rewarded._calls is not env._calls


def test_a_map_of_one_s_own_is_what_is_measured():
    field = jax.tree.map(lambda a: a[0], maipp.draw_missions(SMALL, seed=20, instances=1).field)
    env = surveys.aec_env(SMALL, field=field)
    env.reset(seed=1)
    one = np.asarray(env.simulator_state()[0].truth)
    env.reset(seed=2)
    np.testing.assert_array_equal(one, env.simulator_state()[0].truth)


def test_the_engine_s_own_limit_truncates():
    # Forth and back between two nodes side by side: the record of the route fills before the budget is spent.
    close = SMALL.replace(agents=1, budget=3.0, nodes=150, measurement_interval=3.0)
    env = surveys.aec_env(close)
    env.reset(seed=0)
    steps = 0
    while env.agents:
        observation, _, terminated, truncated, _ = env.last()
        if terminated or truncated:
            break
        env.step(int(np.argmax(observation["action_mask"])))  # neighbours are sorted by distance
        steps += 1
    assert steps == 8 * 1 + 16 and truncated and not terminated
    assert env.rewards["robot_0"] > -0.02 * 64  # no penalty for the end: the survey was cut short


def test_a_picture_and_a_text_show_where_everybody_is():
    env = surveys.aec_env(SMALL, render_mode="ansi")
    env.reset(seed=3)
    for _ in range(5):
        env.step(0)
    text = env.render()
    assert text.startswith("time 0.") and len(text.splitlines()) == 4
    mission, state = env.simulator_state()
    agent = env.possible_agents.index(env.agent_selection)
    x, y = np.asarray(state.leg)[0, agent, -1]
    assert f"{env.agent_selection}  at ({x:.3f}, {y:.3f})" in text
