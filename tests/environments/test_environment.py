"""The functional environment: the survey of the PettingZoo front, pure, under vmap and scan, with resets of its own."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp import Scenario
from maipp.environments import Environment
from maipp.errors import InputError

# The scenario of tests/adapters, so that one process compiles it once.
SMALL = Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)
WORLDS = 6


@pytest.fixture(scope="module")
def env():
    return Environment(SMALL)


@pytest.fixture(scope="module")
def params(env):
    return env.params(seed=3, worlds=4)


def drawn(key: jax.Array, masks: jax.Array) -> jax.Array:
    """An allowed action of every world."""
    return jax.random.categorical(key, jnp.where(masks, 0.0, -jnp.inf))


@pytest.fixture(scope="module")
def played(env, params):
    """Ninety steps of six worlds at once: what was seen and told, and the actions; axes (steps, worlds)."""

    def one(carry: Any, key: jax.Array) -> Any:
        state, seen = carry
        action = drawn(key, seen.action_mask)
        state, new, reward, done, info = jax.vmap(env.step, (0, 0, None))(state, action, params)
        return (state, new), (new, action, reward, done, info)

    def run(key: jax.Array) -> Any:
        start = jax.vmap(env.reset, (0, None))(jax.random.split(key, WORLDS), params)
        return start[1], jax.lax.scan(one, start, jax.random.split(key, 90))[1]

    return jax.device_get(jax.jit(run)(jax.random.key(0)))


def test_worlds_begin_anew_within_the_compiled_step(env, played):
    first, (seen, _, reward, done, info) = played
    assert done.sum() > 2 * WORLDS
    assert (info.time[done] == 0).all() and (reward[done] == 0).all() and (info.agent[done] == 0).all()
    np.testing.assert_array_equal(done[1:], info.last[:-1])  # told one step ahead
    starts = np.unique(seen.vector[done][:, :2].round(5), axis=0)
    assert 1 < len(starts) <= 4  # the params' worlds
    bounds = env.specs.bounds
    assert first.vector.shape[1:] == seen.vector.shape[2:] == env.specs.observation.vector.shape
    assert (seen.vector >= bounds.low).all() and (seen.vector <= bounds.high).all()
    assert seen.action_mask.any(axis=-1).all() and seen.action_mask[info.ended].all()


def test_every_agent_has_one_last_turn_and_is_rewarded_in_it(played):
    _, (_, _, reward, done, info) = played
    for world in range(WORLDS):
        ends = np.flatnonzero(done[:, world])
        for begin, end in zip(ends, ends[1:], strict=False):
            ended = info.ended[begin:end, world]
            assert sorted(info.agent[begin:end, world][ended]) == [0, 1, 2]
            # A budget below the last measurement's worth leaves little; what is left costs 0.02 of it.
            last = -0.02 * info.trace[begin:end, world][ended]
            assert (reward[begin:end, world][ended] >= last - 1e-5).all()


def test_it_goes_through_the_survey_of_the_pettingzoo_front():
    pettingzoo = pytest.importorskip("maipp.adapters.pettingzoo")
    own = Environment(SMALL, reward="log-trace", fields="own")
    params = own.params(seed=3, worlds=4)
    front = pettingzoo.aec_env(SMALL, reward="log-trace")
    step, reset = jax.jit(own.step), jax.jit(own.reset_to)
    for row in (0, 3):
        front.reset(seed=3, options={"instance": row})
        state, seen, info = reset(jax.random.key(0), params, row)
        rng, reward, steps = np.random.default_rng(row), 0.0, 0
        for name in front.agent_iter():
            observation, gained, terminated, truncated, told = front.last()
            assert front.possible_agents.index(name) == int(info.agent) and terminated == bool(info.ended)
            # One program rounds otherwise than another, and a posterior in float32 enlarges that.
            np.testing.assert_allclose(observation["observation"], seen.vector, atol=2e-4)
            assert gained == pytest.approx(float(reward), abs=1e-4)
            assert told["trace"] == pytest.approx(float(info.trace), rel=1e-4)
            if not terminated:
                np.testing.assert_array_equal(observation["action_mask"], seen.action_mask)
            action = int(rng.choice(np.flatnonzero(seen.action_mask)))
            front.step(None if terminated or truncated else action)
            state, seen, reward, done, info = step(state, action, params)
            steps += 1
        assert bool(done) and steps > 9


def test_what_is_no_neighbour_becomes_the_allowed_one_nearest_to_it(env, params):
    state, seen = jax.jit(env.reset)(jax.random.key(5), params)
    candidates = seen.vector[-36:].reshape(4, 9)
    nearest = state.survey.leg[0, -1] + candidates[jnp.argmin(candidates[:, 2]), :2]
    for action, replaced in ((9, True), (-1, True), (int(jnp.argmin(candidates[:, 2])), False)):
        after, *_, info = jax.jit(env.step)(state, action, params)
        assert bool(info.replaced) == replaced
        np.testing.assert_allclose(after.survey.leg[0, -1], nearest, atol=1e-5)


def test_options_are_told_in_one_line():
    wrong: list[tuple[dict[str, Any], str]] = [({"fields": "x"}, "any, own"), ({"view": "x"}, "local, graph")]
    for options, right in wrong:
        with pytest.raises(InputError, match=right):
            Environment(SMALL, **options)


def test_numbers_of_the_params_are_those_of_their_worlds(env, params):
    shorter = eqx.tree_at(lambda p: p.params.budgets, params, params.params.budgets / 2)
    _, _, info = jax.jit(env.reset_to)(jax.random.key(0), shorter, 1)
    assert float(info.remaining) == pytest.approx(0.6)
