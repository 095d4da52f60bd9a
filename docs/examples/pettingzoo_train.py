"""Train a policy of six numbers in the PettingZoo environment, with NumPy alone, and compare it with chance.

An agent goes to the neighbour with the highest score, which is a weighted sum of what it sees of each. All agents share
the weights. The cross-entropy method finds them: draw weights, keep the best quarter, draw around those.
"""

import argparse
from typing import Any

import jax
import numpy as np

import maipp
from maipp.adapters.pettingzoo import CANDIDATE, aec_env, split_view

SCENARIO = maipp.Scenario(agents=3, budget=2.0, grid=15, nodes=60, neighbours=10)
SEEN = [CANDIDATE.index(name) for name in ("length", "mean", "std", "interest", "around", "announced")]


def choose(env: Any, observation: dict[str, np.ndarray], weights: np.ndarray | None, rng: np.random.Generator) -> int:
    """The index of the neighbour to go to: that with the highest score, or without weights any that is allowed."""
    allowed = observation["action_mask"] == 1
    if weights is None:
        return int(rng.choice(np.flatnonzero(allowed)))
    score = split_view(env.scenario, observation["observation"]).candidates[:, SEEN] @ weights
    return int(np.argmax(np.where(allowed, score, -np.inf)))


def survey(env: Any, seed: int, weights: np.ndarray | None, rng: np.random.Generator) -> tuple[float, float]:
    """One survey of the world of this seed: the team's mean reward, and its final Tr(P)."""
    env.reset(seed=seed)
    total = 0.0
    for _ in env.agent_iter():
        observation, reward, terminated, truncated, _ = env.last()
        total += reward
        env.step(None if terminated or truncated else choose(env, observation, weights, rng))
    return total / len(env.possible_agents), float(env.metrics().trace[0])


def train(env: Any, rng: np.random.Generator, rounds: int, draws: int, worlds: int) -> np.ndarray:
    """The weights after this many rounds; all draws of a round meet the same worlds, every round new ones."""
    centre, width = np.zeros(len(SEEN)), np.ones(len(SEEN))
    for generation in range(rounds):
        drawn = centre + width * rng.standard_normal((draws, len(SEEN)))
        seeds = 10_000 + worlds * generation + np.arange(worlds)
        rewards = [np.mean([survey(env, int(seed), weights, rng)[0] for seed in seeds]) for weights in drawn]
        elite = drawn[np.argsort(rewards)[-draws // 4 :]]
        centre, width = elite.mean(axis=0), elite.std(axis=0) + 0.05
        print(f"round {generation + 1}: mean reward {np.mean(rewards):.3f}, best {np.max(rewards):.3f}")
    return centre


def compare(env: Any, weights: np.ndarray, rng: np.random.Generator, worlds: int) -> dict[str, np.ndarray]:
    """Final Tr(P) of chance, the trained policy and a planner on the same worlds, none of which training has met."""
    policies = {"random": None, "trained": weights}
    traces = {name: [survey(env, seed, chosen, rng)[1] for seed in range(worlds)] for name, chosen in policies.items()}
    planner = maipp.make_planner("shared-greedy", env.scenario)
    traces["shared-greedy"] = []
    for seed in range(worlds):
        missions = maipp.draw_missions(env.scenario, seed=seed, instances=1)  # what env.reset(seed=seed) draws
        states = maipp.run_missions(planner, missions, jax.random.key(seed))
        traces["shared-greedy"].append(float(maipp.score_missions(missions, states).trace[0]))
    return {name: np.array(values) for name, values in traces.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=8, help="rounds of the cross-entropy method")
    parser.add_argument("--worlds", type=int, default=30, help="worlds to compare on")
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    env = aec_env(SCENARIO, reward="log-trace")
    weights = train(env, rng, arguments.rounds, draws=16, worlds=3)
    names = [CANDIDATE[column] for column in SEEN]
    print("weights:", ", ".join(f"{name} {value:+.2f}" for name, value in zip(names, weights, strict=True)))
    traces = compare(env, weights, rng, arguments.worlds)
    for name, trace in traces.items():
        error = trace.std(ddof=1) / np.sqrt(len(trace))
        print(f"{name:14} Tr(P) {trace.mean():6.2f} ± {error:.2f}")
    gain = traces["random"] - traces["trained"]
    print(f"random - trained, paired: {gain.mean():.2f} ± {gain.std(ddof=1) / np.sqrt(len(gain)):.2f}")


if __name__ == "__main__":
    main()
