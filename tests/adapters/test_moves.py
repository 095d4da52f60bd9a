"""What an environment takes for an action, what it makes of one that is masked, and what it refuses."""

from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("pettingzoo")

import maipp.adapters.pettingzoo as environments  # noqa: E402
from maipp import Scenario  # noqa: E402
from maipp.errors import InputError  # noqa: E402

surveys: Any = environments  # its observations are arrays or dictionaries, by the options
SMALL = Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)
# Unequal robots that seldom hear each other: what is known, and who is due when, depends on the order of events.
UNEQUAL = SMALL.replace(budget=(1.2, 0.9, 1.1), speed=(1.0, 0.7, 1.3), comm_range=0.3, last_leg="stop")
# Two zones between which a leg fits.
ZONES = SMALL.replace(
    obstacles=(((0.3, 0.0), (0.4, 0.0), (0.4, 0.6), (0.3, 0.6)), ((0.7, 0.4), (0.8, 0.4), (0.8, 1.0))), start=(0.1, 0.1)
)


@settings(max_examples=12)
@given(seed=st.integers(0, 30), data=st.data())
def test_masked_actions_are_replaced_by_the_nearest_that_is_allowed(seed, data):
    env = surveys.aec_env(UNEQUAL)
    env.reset(seed=seed)
    for agent in env.agent_iter():
        observation, _, terminated, truncated, info = env.last()
        if terminated or truncated:
            env.step(None)
            continue
        action = data.draw(st.integers(0, 3))
        allowed = observation["action_mask"].astype(bool)
        candidates = surveys.split_view(UNEQUAL, observation["observation"]).candidates
        squared = ((candidates[:, :2] - candidates[action, :2]) ** 2).sum(axis=1)
        taken = action if allowed[action] else int(np.argmin(np.where(allowed, squared, np.inf)))
        target = np.asarray(env.simulator_state()[1].leg)[0, env.possible_agents.index(agent), -1]
        target = target + candidates[taken, :2]
        env.step(action)
        went = np.asarray(env.simulator_state()[1].leg)[0, env.possible_agents.index(agent), -1]
        np.testing.assert_allclose(went, target, atol=1e-5)


@pytest.mark.parametrize("kind", ["aec", "parallel"])
def test_masked_actions_can_be_refused(kind):
    make = surveys.aec_env if kind == "aec" else surveys.parallel_env
    env = make(ZONES.replace(neighbours=8), masked="raise", actions="neighbour")
    env.reset(seed=0)
    before = env.simulator_state()[1]
    if kind == "parallel":
        with pytest.raises(InputError, match=r"robot_0: action 8 is masked; allowed now: \[0, 1"):
            env.step(dict.fromkeys(env.agents, 8))
    else:
        mask = env.last()[0]["action_mask"]
        for action in np.flatnonzero(mask == 0):
            with pytest.raises(InputError, match="is masked; allowed now"):
                env.step(action)
    jax.tree.map(np.testing.assert_array_equal, env.simulator_state()[1], before)


NO_ACTIONS = st.one_of(
    st.integers(min_value=5),
    st.integers(max_value=-1),
    st.floats(),
    st.text(max_size=5),
    st.none(),
    st.lists(st.floats()),
)


@settings(max_examples=20)  # each makes two environments
@given(action=NO_ACTIONS)
def test_what_is_no_action_is_told_and_changes_nothing(action):
    env, other = surveys.aec_env(SMALL), surveys.parallel_env(SMALL)
    for each in (env, other):
        each.reset(seed=0)
    with pytest.raises(InputError, match="robot_0: .* is not an action; give a member of Discrete") as caught:
        env.step(action)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="robot_1: .* is not an action"):
        other.step({"robot_0": 0, "robot_1": action, "robot_2": 0})
    assert env.agent_selection == "robot_0" and (other.simulator_state()[1].events == 0).all()


@given(action=st.lists(st.floats(width=32), min_size=2, max_size=2))
def test_waypoints_anywhere_but_in_the_domain_are_refused(action):
    env = surveys.aec_env(SMALL, actions="waypoint")
    env.reset(seed=0)
    place = np.array(action, np.float32)
    if ((place >= 0) & (place <= 1)).all():
        env.step(place)
        assert env.simulator_state()[1].events[0] == 1
    else:
        with pytest.raises(InputError, match="is not an action; give a member of Box"):
            env.step(place)


def test_waypoints_are_cut_at_the_budget_and_a_waypoint_on_the_spot_ends_the_survey():
    env = surveys.aec_env(SMALL.replace(agents=1, start=(0.0, 0.0)), actions="waypoint")
    env.reset(seed=0)
    env.step(np.array([1.0, 1.0], np.float32))
    assert env.terminations["robot_0"]
    final = env.simulator_state()[1]
    assert float(final.odometer[0, 0]) == pytest.approx(1.2, abs=1e-5) and int(final.taken[0, 0]) == 6
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    assert env.terminations["robot_0"] and env.last()[1] == pytest.approx(-0.02 * 64, rel=1e-3)
    env.step(None)
    assert not env.agents and not env.simulator_state()[1].active.any()


def test_a_missing_action_is_told():
    env = surveys.parallel_env(SMALL)
    env.reset(seed=0)
    with pytest.raises(InputError, match="robot_2: no action"):
        env.step({"robot_0": 0, "robot_1": 0})


def test_in_parallel_too_a_waypoint_on_the_spot_ends_one_survey_alone():
    env = surveys.parallel_env(SMALL.replace(start=(0.5, 0.5)), actions="waypoint")
    env.reset(seed=0)
    middle, corner = np.array([0.5, 0.5], np.float32), np.array([1.0, 1.0], np.float32)
    _, rewards, terminations, truncations, _ = env.step({"robot_0": corner, "robot_1": middle, "robot_2": corner})
    assert terminations == {"robot_0": False, "robot_1": True, "robot_2": False} and not any(truncations.values())
    assert rewards["robot_1"] == pytest.approx(-0.02 * 64, rel=1e-3)
    assert env.agents == ["robot_0", "robot_2"]
    env.step({"robot_0": np.zeros(2, np.float32), "robot_2": np.zeros(2, np.float32)})
    assert not env.agents and not env.simulator_state()[1].active.any()
