"""Stable-Baselines3 on a team that acts in turns: PPO, or MaskablePPO of sb3-contrib, which never asks what is masked.

pip install 'maipp[rl]' stable-baselines3 sb3-contrib
"""

import argparse
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

import maipp
from maipp.adapters.gymnasium import SurveyEnv

SCENARIO = maipp.Scenario(agents=3, budget=2.0, grid=15, nodes=60, neighbours=10)


def learner(scenario: maipp.Scenario, masked: bool, seed: int = 0) -> Any:
    """A learner on eight environments in this process; the rewards of a survey sum to the drop of log Tr(P)."""
    if masked:
        from sb3_contrib import MaskablePPO as PPOClass
    else:
        PPOClass = PPO
    # To have the environments in processes of their own: vec_env_cls=SubprocVecEnv,
    # vec_env_kwargs={"start_method": "forkserver"}; a process forked after JAX has started cannot use it.
    options = {"observations": "box", "reward": "log-trace"}
    envs = make_vec_env(lambda: SurveyEnv(scenario, **options), n_envs=8, seed=seed)
    return PPOClass("MlpPolicy", envs, n_steps=128, batch_size=256, learning_rate=1e-3, seed=seed, device="cpu")


def score(model: Any, scenario: maipp.Scenario, worlds: int, masked: bool) -> np.ndarray:
    """Final Tr(P) on worlds 0 to `worlds - 1` of seed 0, those of `maipp evaluate`."""
    env = SurveyEnv(scenario, observations="box", reward="log-trace")
    traces = []
    for instance in range(worlds):
        observation, _ = env.reset(seed=0, options={"instance": instance})
        over = False
        while not over:
            masks = {"action_masks": env.action_masks()} if masked else {}
            action, _ = model.predict(observation, deterministic=False, **masks)
            observation, _, terminated, truncated, _ = env.step(action)
            over = terminated or truncated
        traces.append(env.metrics().trace[0])
    return np.array(traces, float)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--masked", action="store_true", help="MaskablePPO in place of PPO")
    parser.add_argument("--decisions", type=int, default=40_000, help="decisions to learn from")
    arguments = parser.parse_args()
    model = learner(SCENARIO, arguments.masked)
    before = score(model, SCENARIO, 20, arguments.masked)
    model.learn(arguments.decisions)
    gain = before - score(model, SCENARIO, 20, arguments.masked)
    print(
        f"Tr(P) {before.mean():.1f} before, {gain.mean():.1f} ± {gain.std(ddof=1) / 20**0.5:.1f} less after, in pairs"
    )


if __name__ == "__main__":
    main()
