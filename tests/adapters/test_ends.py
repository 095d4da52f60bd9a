"""What an agent is told last is of the moment its own survey ended, whatever passes until the step returns."""

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pettingzoo")

import maipp.adapters.pettingzoo as environments  # noqa: E402
from maipp import Scenario  # noqa: E402

surveys: Any = environments  # its observations are arrays or dictionaries, by the options
SMALL = Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)
# Legs are cut where the budget ends, and the budgets end one after the other.
CUT = SMALL.replace(budget=(1.2, 0.7, 1.0))
# Unequal robots that seldom hear each other: they end one after the other, and know different things.
UNEQUAL = SMALL.replace(budget=(1.2, 0.9, 1.1), speed=(1.0, 0.7, 1.3), comm_range=0.3, last_leg="stop")


class Told:
    """What each agent was told first and last, and the sum of its rewards."""

    def __init__(self):
        self.first, self.last, self.total = {}, {}, {}

    def add(self, agent, observation, reward, info):
        self.first.setdefault(agent, info["trace"])
        self.last[agent] = observation, info
        self.total[agent] = self.total.get(agent, 0.0) + reward


def pick(seed, mask):
    """An allowed action, the same wherever the same is allowed."""
    allowed = np.flatnonzero(mask)
    return int(allowed[seed % len(allowed)])


def in_turns(scenario, seed):
    """The environment after a survey of `aec_env`, and what was told."""
    env, told = surveys.aec_env(scenario, reward="log-trace"), Told()
    env.reset(seed=seed)
    for agent in env.agent_iter():
        observation, reward, terminated, truncated, info = env.last()
        told.add(agent, observation, reward, info)
        env.step(None if terminated or truncated else pick(seed, observation["action_mask"]))
    return env, told


def together(scenario, seed):
    """The same of `parallel_env`."""
    env, told = surveys.parallel_env(scenario, reward="log-trace"), Told()
    observations, infos = env.reset(seed=seed)
    for name in env.agents:
        told.add(name, observations[name], 0.0, infos[name])
    while env.agents:
        actions = {name: pick(seed, observations[name]["action_mask"]) for name in env.agents}
        observations, rewards, *_, infos = env.step(actions)
        for name, reward in rewards.items():
            told.add(name, observations[name], reward, infos[name])
    return env, told


@pytest.mark.parametrize("play", [in_turns, together], ids=["in turns", "together"])
@pytest.mark.parametrize("scenario", [CUT, UNEQUAL], ids=["cut", "unequal"])
def test_an_agent_is_told_last_of_its_own_end(scenario, play):
    for seed in range(5):
        env, told = play(scenario, seed)
        state = env.simulator_state()[1]
        for index, agent in enumerate(env.possible_agents):
            observation, info = told.last[agent]
            own = surveys.split_view(scenario, observation["observation"]).own
            end = float(state.route_time[0, index, int(state.route_length[0, index]) - 1])
            left = scenario.budgets[index] - float(state.odometer[0, index])
            assert info["time"] == pytest.approx(end, abs=1e-4)
            assert info["remaining"] == pytest.approx(left, abs=1e-5)
            assert info["trace"] == pytest.approx(told.first[agent] * math.exp(-told.total[agent]), rel=1e-3)
            assert own[6] * scenario.grid_points == pytest.approx(info["trace"], rel=1e-5)
            assert not info["travelling"] and not observation["action_mask"].any()


def test_both_environments_tell_the_same_last():
    for seed in range(5):
        turns, all_at_once = in_turns(UNEQUAL, seed)[1].last, together(UNEQUAL, seed)[1].last
        for agent, (observation, info) in turns.items():
            other, other_info = all_at_once[agent]
            np.testing.assert_allclose(other["observation"], observation["observation"], atol=1e-4)
            assert other_info == pytest.approx(info, rel=1e-4, abs=1e-4)


def test_who_ends_on_the_spot_is_told_of_where_it_ended():
    env = surveys.parallel_env(SMALL.replace(start=(0.5, 0.5)), actions="waypoint", reward="log-trace")
    env.reset(seed=0)
    middle, corner = np.array([0.5, 0.5], np.float32), np.array([1.0, 1.0], np.float32)
    observations, _, terminations, _, infos = env.step({"robot_0": corner, "robot_1": middle, "robot_2": corner})
    assert terminations["robot_1"] and infos["robot_1"]["time"] == 0.0 and not infos["robot_1"]["travelling"]
    assert infos["robot_1"]["trace"] == pytest.approx(64.0, rel=1e-3)
    parts = surveys.split_view(SMALL, observations["robot_1"])
    assert (parts.team[:, 1:3] == 0).all()  # the others, who set off at the same moment, were still beside it
    assert infos["robot_0"]["time"] > 0.5


def test_who_is_cut_off_under_way_is_told_so():
    env = surveys.parallel_env(UNEQUAL, max_cycles=2)
    observations, infos = env.reset(seed=0)
    while env.agents:
        actions = {name: pick(0, observations[name]["action_mask"]) for name in env.agents}
        observations, _, terminations, truncations, infos = env.step(actions)
    assert all(truncations.values()) and not any(terminations.values())
    state = env.simulator_state()[1]
    time = min(float(arrival) for arrival in state.arrival[0])
    for index, name in enumerate(env.possible_agents):
        assert infos[name]["time"] == pytest.approx(time, abs=1e-5)
        assert infos[name]["travelling"] == (float(state.arrival[0, index]) > time + 1e-4)
    assert {info["travelling"] for info in infos.values()} == {True, False}
