"""The environments keep to PettingZoo's API, by PettingZoo's own tests."""

import warnings
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pettingzoo")
from pettingzoo.test import (  # noqa: E402
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
    seed_test,
)

import maipp.adapters.pettingzoo as environments  # noqa: E402
from maipp.errors import InputError  # noqa: E402
from tests.conftest import slow  # noqa: E402

surveys: Any = environments
FORMS = [{}, {"view": "graph"}, {"actions": "waypoint"}]
# What PettingZoo's tests say of every environment that keeps its mask in the observation, its board games included.
EXPECTED = ("Observation is not a NumPy array", "Observation space for each agent probably should be")

IDS = ["local", "graph", "waypoint"]
forms = pytest.mark.parametrize("form", FORMS, ids=IDS)
first_form = pytest.mark.parametrize("form", [FORMS[0], *map(slow, FORMS[1:])], ids=IDS)


@pytest.fixture(autouse=True)
def nothing_else_is_wrong():
    """The conformance tests warn of much that they let pass; here nothing but the mask's place passes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    told = [str(each.message) for each in caught if issubclass(each.category, UserWarning)]
    assert [text for text in told if not text.startswith(EXPECTED)] == []


@first_form
def test_aec(small, form):
    api_test(surveys.env(small, **form), num_cycles=60)
    api_test(surveys.aec_env(small, **form), num_cycles=20)


@first_form
def test_parallel(small, form):
    parallel_api_test(surveys.parallel_env(small, **form), num_cycles=60)


@pytest.mark.slow
@forms
def test_seeds(small, form):
    seed_test(partial(surveys.env, small, **form), num_cycles=30)
    parallel_seed_test(partial(surveys.parallel_env, small, **form), num_cycles=30)


@pytest.mark.slow
def test_pictures(small):
    render_test(partial(surveys.env, small))


@pytest.mark.slow
@forms
def test_max_cycles(small, form):
    long = small.replace(budget=12.0) if form.get("actions") == "waypoint" else small
    module = SimpleNamespace(
        env=partial(surveys.env, long, **form), parallel_env=partial(surveys.parallel_env, long, **form)
    )
    max_cycles_test(module)


def test_the_default_is_the_paper_s_scenario():
    env = surveys.aec_env()
    assert env.possible_agents == ["robot_0", "robot_1", "robot_2"]
    assert env.action_space("robot_0").n == 20
    low = env.observation_space("robot_0")["observation"].low
    assert low.shape == (len(surveys.OWN) + 2 * len(surveys.TEAM) + 20 * len(surveys.CANDIDATE),)


def test_the_blocks_of_a_view_are_found_again(small):
    env = surveys.aec_env(small)
    env.reset(seed=1)
    vector = env.last()[0]["observation"]
    parts = surveys.split_view(small, np.stack([vector, vector]))
    assert [part.shape for part in parts] == [(2, 8), (2, 2, 6), (2, 4, 9)]
    assert (np.concatenate([part[0].ravel() for part in parts]) == vector).all()
    with pytest.raises(InputError, match="56 numbers; this scenario's have 56|55 numbers"):
        surveys.split_view(small, vector[:-1])


@pytest.mark.parametrize(
    ("options", "right"),
    [
        ({"actions": "jump"}, "give one of neighbour, waypoint"),
        ({"view": "photo"}, "give one of local, graph"),
        ({"reward": "none"}, "give one of paper, log-trace"),
        ({"masked": "ignore"}, "give one of nearest, raise"),
        ({"render_mode": "film"}, "give one of human, rgb_array, ansi"),
        ({"max_cycles": 0}, "give a whole number >= 1"),
        ({"actions": "waypoint", "view": "graph"}, "give actions='neighbour'"),
    ],
)
def test_options_that_make_no_sense_are_told_in_one_line(small, options, right):
    for make in (surveys.env, surveys.aec_env, surveys.parallel_env):
        with pytest.raises(InputError, match=right) as caught:
            make(small, **options)
        assert "\n" not in str(caught.value)


def test_waypoints_are_refused_where_there_are_no_go_zones(small):
    zone = ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6))
    with pytest.raises(InputError, match="no-go zones"):
        surveys.env(small.replace(obstacles=(zone,)), actions="waypoint")


@pytest.mark.parametrize("make", [surveys.aec_env, surveys.parallel_env])
@pytest.mark.parametrize("seed", [-1, 2**32])
def test_seeds_out_of_range_are_refused(small, make, seed):
    with pytest.raises(InputError, match="give a whole number from 0 to 4294967295"):
        make(small).reset(seed=seed)


@pytest.mark.parametrize("make", [surveys.aec_env, surveys.parallel_env])
@pytest.mark.parametrize("seed", [3_000_000_000, 2**32 - 1])
def test_large_seeds_are_worlds_of_their_own(small, make, seed):
    starts = []
    for given in (seed, seed, seed - 2**31):
        env = make(small)
        env.reset(seed=given)
        starts.append(np.asarray(env.unwrapped.simulator_state()[0].start))
    assert (starts[0] == starts[1]).all() and (starts[0] != starts[2]).any()
