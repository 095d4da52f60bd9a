"""`python -m tests.tools.environment_speed`: decisions per CPU second of the environments, on one core.

With `--also SRC`, the PettingZoo fronts of another source tree as well: round by round in turns with those here, since
what else a machine does changes what a core gets done.
"""

import os
import statistics
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
    """times that each is timed; the best one counts, and the median of the ratios"""
    also: Path | None = None
    """src folder of another tree"""
    answer: bool = False
    """time a round of the front that each line of the input names (this is how the other tree is asked)"""
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


IN_TURNS = "aec", "parallel"  # what the other tree is asked for as well


class Rounds:
    """Rounds of the fronts of this process, each compiled when it is first asked for."""

    def __init__(self, size: str, worlds: int) -> None:
        self.size, self.worlds = size, worlds
        self.plays: dict[str, Callable[[], int]] = {}

    def rate(self, front: str) -> float:
        """Decisions per CPU second of one round."""
        import maipp

        if front not in self.plays:
            self.plays[front] = FRONTS[front](maipp.Scenario(**SIZES[self.size]), self.worlds)
            self.plays[front]()
        began = time.process_time()
        decisions = self.plays[front]()
        return decisions / (time.process_time() - began)


class There:
    """The same of another source tree, in a process of its own."""

    def __init__(self, size: str, src: Path) -> None:
        command = [sys.executable, __file__, "--size", size, "--answer"]
        environment = os.environ | {"PYTHONPATH": str(src)}
        self.process = subprocess.Popen(
            command, env=environment, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def rate(self, front: str) -> float:
        """Decisions per CPU second of one round. Raises RuntimeError where the process has ended."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(f"{front}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the other tree's process ended with exit code {self.process.wait()}")
        return float(answer)

    def end(self) -> None:
        """Let the process end."""
        self.process.communicate()


def main(flags: EnvironmentSpeed | None = None) -> int:
    """Print decisions per CPU second of each front; `flags` are those of the command line where None."""
    flags = flags or tyro.cli(EnvironmentSpeed)
    if flags.also is not None and not (flags.also / "maipp").is_dir():
        print(f"error: --also {flags.also}: no folder maipp in it; give the src folder of a tree", file=sys.stderr)
        return 2
    use_one_core()
    here = Rounds(flags.size, flags.worlds)
    if flags.answer:
        for line in sys.stdin:
            print(here.rate(line.strip()), flush=True)
        return 0
    import maipp

    there = None if flags.also is None else There(flags.size, flags.also)
    print(f"{Path(maipp.__file__).parent}, {flags.size}: {SIZES[flags.size]}", flush=True)
    for name in flags.fronts:
        both = there is not None and name in IN_TURNS
        rates = [(here.rate(name), there.rate(name) if there and both else 1.0) for _ in range(flags.repeat)]
        best, other = (max(rate[side] for rate in rates) for side in (0, 1))
        ratio = statistics.median(one / two for one, two in rates)
        also = f", there {other:.0f}; ratio {best / other:.2f}, median of rounds {ratio:.2f}" if both else ""
        print(f"{name:10} {best:8.0f} decisions per CPU second{also}", flush=True)
    if there is not None:
        there.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
