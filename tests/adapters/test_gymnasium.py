"""The fronts for Gymnasium, the Box form and what all fronts have in common, by the libraries' own checks."""

import multiprocessing
import pickle
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pettingzoo")
from gymnasium.utils.env_checker import check_env  # noqa: E402

import maipp.adapters.pettingzoo as environments  # noqa: E402
from maipp.adapters.gymnasium import SurveyEnv, SurveyVectorEnv  # noqa: E402
from maipp.errors import InputError  # noqa: E402

surveys: Any = environments


@pytest.mark.filterwarnings("ignore:.*Not able to test alternative render modes")
@pytest.mark.parametrize("options", [{}, {"observations": "box"}, {"actions": "waypoint"}])
def test_a_team_is_a_gymnasium_environment(small, options):
    check_env(SurveyEnv(small, **options))


def test_many_worlds_are_a_vector_environment(small):
    env, again = (SurveyVectorEnv(small, 3, worlds=4) for _ in range(2))
    seen, _ = env.reset(seed=1)
    other, _ = again.reset(seed=1)
    rng, ends, total = np.random.default_rng(0), 0, 0.0
    over = np.zeros(3, bool)
    for _ in range(40):
        assert env.observation_space.contains(seen)
        np.testing.assert_equal(seen, other)
        actions = rng.integers(4, size=3)  # masked ones are replaced
        was = over
        (seen, reward, over, cut, info), (other, *_) = env.step(actions), again.step(actions)
        assert reward.shape == over.shape == cut.shape == (3,) and reward.dtype == np.float64
        assert (info["time"][was] == 0).all() and (reward[was] == 0).all()  # begun anew in the step after the end
        ends, total = ends + over.sum(), total + reward.sum()
    assert ends >= 3 and total != 0
    with pytest.raises(InputError, match="give a member of"):
        env.step(np.array([0, 1, 9]))
    box = SurveyVectorEnv(small, 3, worlds=4, observations="box")
    np.testing.assert_array_equal(box.reset(seed=1)[0], again.reset(seed=1)[0]["observation"])
    assert (box.step(actions)[-1]["action_mask"] == again.step(actions)[0]["action_mask"]).all()


def test_a_survey_of_the_team_has_the_rewards_of_its_robots(small):
    team, robots = SurveyEnv(small, reward="log-trace"), surveys.aec_env(small, reward="log-trace")
    for instance in range(3):
        seen, _ = team.reset(seed=2, options={"instance": instance})
        robots.reset(seed=2, options={"instance": instance})
        over, total, wanted, choices = False, 0.0, 0.0, []
        while not over:
            choices.append(int(np.flatnonzero(seen["action_mask"])[-1]))
            seen, reward, over, _, _ = team.step(choices[-1])
            total += reward
        ways = iter(choices)
        for _ in robots.agent_iter():
            _, reward, ended, cut, _ = robots.last()
            wanted += reward
            robots.step(None if ended or cut else next(ways))
        assert total == pytest.approx(wanted, rel=1e-5) and next(ways, None) is None
        np.testing.assert_allclose(team.metrics().trace, robots.metrics().trace, rtol=1e-5)


@pytest.mark.parametrize("make", [surveys.aec_env, surveys.parallel_env, SurveyEnv])
def test_what_is_out_of_order_or_unknown_is_told(small, make):
    env = make(small, render_mode="ansi")
    for call in (env.render, env.state, env.metrics):
        with pytest.raises(InputError, match=r"call reset\(\) first"):
            call()
    with pytest.raises(InputError, match="'instanse' unknown; there is 'instance'"):
        env.reset(options={"instanse": 1})
    with pytest.raises(InputError, match="give a whole number >= 0"):
        env.reset(options={"instance": -1})
    with pytest.raises(InputError, match="give view='local'"):
        make(small, observations="box", view="graph")


def test_the_global_state_is_in_its_space_and_holds_the_truth(small):
    aec, parallel = surveys.aec_env(small), surveys.parallel_env(small)
    for env in (aec, parallel):
        env.reset(seed=5)
        assert env.state_space.contains(env.state())
    np.testing.assert_allclose(aec.state(), parallel.state(), atol=1e-5)
    np.testing.assert_allclose(aec.state()[-64:], aec.simulator_state()[0].truth[0], atol=1e-6)
    before = aec.state()
    for _ in range(6):
        aec.step(int(np.argmax(aec.last()[0]["action_mask"])))
    after = aec.state()
    assert aec.state_space.contains(after) and after[18 + 64 : 18 + 128].sum() < before[18 + 64 : 18 + 128].sum()


def test_boxes_hold_the_same_and_the_mask_is_told(small):
    box, both = surveys.parallel_env(small, observations="box"), surveys.parallel_env(small)
    (seen, infos), (wanted, _) = box.reset(seed=4), both.reset(seed=4)
    for name in box.agents:
        np.testing.assert_array_equal(seen[name], wanted[name]["observation"])
        np.testing.assert_array_equal(infos[name]["action_mask"], wanted[name]["action_mask"])


def test_waypoints_may_be_of_double_precision(small):
    env = surveys.aec_env(small, actions="waypoint")
    env.reset(seed=0)
    env.step(np.array([0.25, 0.75]))
    assert env.simulator_state()[1].events[0] == 1


@pytest.mark.parametrize("make", [surveys.aec_env, surveys.parallel_env])
def test_a_pickled_survey_goes_on_as_it_was(small, make):
    env = make(small)
    env.reset(seed=1)
    other = pickle.loads(pickle.dumps(env))
    for each in (env, other):
        each.step(0 if make is surveys.aec_env else dict.fromkeys(env.possible_agents, 0))
    np.testing.assert_array_equal(env.state(), other.state())


def _step(queue, env):
    try:
        env.reset(seed=0)
        queue.put("it ran")
    except InputError as error:
        queue.put(str(error))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no forks here")
@pytest.mark.filterwarnings("ignore:.*fork", "ignore::DeprecationWarning")
def test_a_fork_that_would_hang_is_refused(small):
    env = surveys.aec_env(small)
    env.reset(seed=0)  # JAX runs
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    child = context.Process(target=_step, args=(queue, env))
    child.start()
    child.join(60)
    assert child.exitcode == 0 and "'spawn' or 'forkserver'" in queue.get()
