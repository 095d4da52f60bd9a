"""The recipes in docs/examples/recipes do what they say; those for other libraries where these are installed."""

import importlib
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

import maipp
from maipp import Scenario
from maipp.environments import Environment

RECIPES = Path(__file__).parents[2] / "docs" / "examples" / "recipes"
SMALL = Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)


@pytest.fixture(autouse=True)
def _recipes(monkeypatch):
    monkeypatch.syspath_prepend(str(RECIPES))
    yield
    for name in ("jax_ppo", "my_policy", "sb3", "torchrl_rollout"):
        sys.modules.pop(name, None)


@pytest.mark.slow
def test_ppo_learns_and_its_policy_is_a_planner(tmp_path, monkeypatch):
    recipe = importlib.import_module("jax_ppo")
    weights, rewards = recipe.train(SMALL, updates=12)
    assert rewards[-3:].mean() > 1.3 * rewards[:3].mean()
    np.savez(tmp_path / "policy.npz", **weights)

    planner = importlib.import_module("my_policy").MyPolicy(SMALL, weights=str(tmp_path / "policy.npz"))
    missions = maipp.draw_missions(SMALL, seed=4, instances=4, planner=planner)
    final = maipp.run_missions(planner, missions, jax.random.key(0))
    # In the environment the same policy goes the same ways.
    env = Environment(SMALL, fields="own")
    step, reset = jax.jit(env.step), jax.jit(env.reset_to)
    for row in range(2):
        state, seen, info = reset(jax.random.key(0), missions, row)
        while not info.last:
            logits, _ = recipe.network(weights, seen.vector, seen.action_mask)
            state, seen, _, _, info = step(state, int(np.argmax(logits)), missions)
        np.testing.assert_allclose(state.survey.route[:, :5], final.route[row, :, :5], atol=1e-4)
        np.testing.assert_allclose(state.survey.odometer, final.odometer[row], atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("masked", [False, True], ids=["PPO", "MaskablePPO"])
def test_stable_baselines_learns(masked):
    pytest.importorskip("sb3_contrib" if masked else "stable_baselines3")
    recipe = importlib.import_module("sb3")
    model = recipe.learner(SMALL, masked)
    before = recipe.score(model, SMALL, 20, masked)
    gain = before - recipe.score(model.learn(16_384), SMALL, 20, masked)
    assert gain.mean() > 3 * gain.std(ddof=1) / np.sqrt(len(gain))


def test_torchrl_reads_the_specs():
    pytest.importorskip("torchrl")
    recipe = importlib.import_module("torchrl_rollout")
    for env in recipe.environments(SMALL).values():
        recipe.check_env_specs(env)
