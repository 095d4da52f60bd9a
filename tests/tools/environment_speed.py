"""`python -m tests.tools.environment_speed`: decisions per CPU second of the environments, on one core.

With `--also SRC`, the PettingZoo fronts of another source tree as well, in turns with those here.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from maipp.devices import use_one_core

SIZES = {
    "small": {"agents": 3, "budget": 1.2, "grid": 10, "nodes": 40, "neighbours": 6},
    "page": {"agents": 3, "budget": 2.0, "grid": 15, "nodes": 60, "neighbours": 10},  # that of docs/pettingzoo.md
}


@dataclass(frozen=True)
class EnvironmentSpeed:
    """Time random decisions: the functional environment, the vector front and the PettingZoo fronts."""

    size: Annotated[str, tyro.conf.arg(help=f"one of {', '.join(SIZES)}")] = "small"
    worlds: int = 64
    """worlds of the functional environment and of the vector front"""
    repeat: int = 3
    """times that each is timed; the best one counts"""
    also: Path | None = None
    """src folder of another tree"""
    fronts: tuple[str, ...] = ("functional", "vector", "aec", "parallel")
    """which of them"""


def functional(scenario: Any, worlds: int) -> Callable[[], int]:
    """A hundred steps of all worlds in one program."""
    import jax
    import jax.numpy as jnp

    from maipp import Environment

    env = Environment(scenario)
    params = env.params(seed=0, worlds=256)

    def one(carry: Any, key: Any) -> Any:
        state, seen, last = carry
        action = jax.random.categorical(key, jnp.where(seen.action_mask, 0.0, -jnp.inf))
        state, seen, _, _, info = jax.vmap(env.step, (0, 0, None))(state, action, params)
        return (state, seen, info.ended), jnp.sum(~last)

    keys = jax.random.split(jax.random.key(0), worlds)
    carry = *jax.jit(jax.vmap(env.reset, (0, None)))(keys, params), jnp.zeros(worlds, bool)
    run = jax.jit(lambda carry, key: jax.lax.scan(one, carry, jax.random.split(key, 100)))

    def play() -> int:
        nonlocal carry
        carry, decisions = run(carry, jax.random.key(0))
        return int(decisions.sum())  # the last turn of an agent, which decides nothing, does not count

    return play


def vector(scenario: Any, worlds: int) -> Callable[[], int]:
    """A hundred steps of the vector front; last turns do not count here either."""
    import numpy as np

    from maipp.adapters.gymnasium import SurveyVectorEnv

    env, rng = SurveyVectorEnv(scenario, worlds), np.random.default_rng(0)
    env.reset(seed=0)

    def play() -> int:
        ended, decisions = np.zeros(worlds, bool), 0
        for _ in range(100):
            decisions += int((~ended).sum())
            ended = env.step(rng.integers(scenario.neighbours, size=worlds))[-1]["ended"]
        return decisions

    return play


def aec(scenario: Any, _: int) -> Callable[[], int]:
    """Twenty surveys in turns."""
    import numpy as np

    from maipp.adapters.pettingzoo import aec_env

    env, rng = aec_env(scenario), np.random.default_rng(0)

    def play() -> int:
        decisions = 0
        for seed in range(20):
            env.reset(seed=seed)
            while env.agents:
                observation, _, terminated, truncated, _ = env.last()
                assert observation is not None
                over = terminated or truncated
                env.step(None if over else int(rng.choice(np.flatnonzero(observation["action_mask"]))))
                decisions += not over
        return decisions

    return play


def parallel(scenario: Any, _: int) -> Callable[[], int]:
    """Twenty surveys together."""
    import numpy as np

    from maipp.adapters.pettingzoo import parallel_env

    env, rng = parallel_env(scenario), np.random.default_rng(0)

    def play() -> int:
        decisions = 0
        for seed in range(20):
            seen, infos = env.reset(seed=seed)
            while env.agents:
                decisions += sum(not infos[name]["travelling"] for name in env.agents)
                choices = {name: int(rng.choice(np.flatnonzero(seen[name]["action_mask"]))) for name in env.agents}
                seen, _, _, _, infos = env.step(choices)
        return decisions

    return play


FRONTS = {"functional": functional, "vector": vector, "aec": aec, "parallel": parallel}


def main() -> int:
    """Print decisions per CPU second of each front."""
    flags = tyro.cli(EnvironmentSpeed)
    use_one_core()
    import maipp

    print(f"{Path(maipp.__file__).parent}, {flags.size}: {SIZES[flags.size]}", flush=True)
    for name in flags.fronts:
        play = FRONTS[name](maipp.Scenario(**SIZES[flags.size]), flags.worlds)
        play()
        best = 0.0
        for _ in range(flags.repeat):
            began = time.process_time()
            decisions = play()
            best = max(best, decisions / (time.process_time() - began))
        print(f"{name:10} {best:8.0f} decisions per CPU second ({decisions} decisions)", flush=True)
    if flags.also is not None:
        there = [sys.executable, __file__, "--size", flags.size, "--repeat", str(flags.repeat)]
        return subprocess.run([*there, "--fronts", "aec", "parallel"], env={"PYTHONPATH": str(flags.also)}).returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
