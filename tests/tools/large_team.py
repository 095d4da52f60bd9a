"""`python -m tests.tools.large_team`: one mission of a large team in one compiled batch, its time and its memory.

With `--knows`, one decision of a team that knows so many measurements, as `maipp benchmark scaling` times it. Every
planner runs in a process of its own on one core, so that the most memory is its own. One line of CSV each.
"""

import multiprocessing
import os
import resource
import sys
import time
from dataclasses import dataclass

import tyro

from maipp.devices import use_one_core
from maipp.errors import InputError


@dataclass(frozen=True)
class LargeTeam:
    """Run one mission of a large team to its end."""

    planner: tuple[str, ...] = ("lawnmower", "shared-greedy", "receding-horizon")
    """planners to run, one after the other"""
    agents: int = 1000
    """robots of the team"""
    budget: float = 1.0
    """of each, domain units"""
    seed: int = 0
    """of the world and the planner"""
    knows: int | None = None
    """measurements that the team knows already: then one decision is timed"""


def decision(name: str, agents: int, knows: int, seed: int) -> str:
    """One decision on one core: planner, robots, measurements known, CPU ms (median of 20), MiB that it needs."""
    use_one_core()
    from maipp.bench.scaling import Size, measure

    size = Size(agents, knows, grid=30, nodes=200)
    cost = measure(name, "agents", size, length_scale=0.25, capacity=None, least=20, seed=seed)
    return f"{name},{agents},{knows},{cost.decision_ms:.1f},{cost.memory_mb:.1f}"


def run(name: str, agents: int, budget: float, seed: int) -> str:
    """One mission on one core: planner, robots, decisions, CPU seconds, ms a decision, most MiB of the process."""
    use_one_core()
    import jax

    from maipp.engine import draw_missions, run_missions
    from maipp.planners import make_planner
    from maipp.scenario import Scenario

    scenario = Scenario.create(agents=agents, budget=budget)
    planner = make_planner(name, scenario)
    missions = draw_missions(scenario, seed=seed, instances=1, planner=planner)
    begun = time.process_time()
    states = jax.block_until_ready(run_missions(planner, missions, jax.random.key(seed)))
    seconds, decisions = time.process_time() - begun, int(states.events.sum())
    measured = int(states.taken.sum())
    if bool(states.active.any()):
        raise InputError(f"{name}: not all robots came to an end")
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # KiB on Linux
    return f"{name},{agents},{decisions},{measured},{seconds:.1f},{1e3 * seconds / decisions:.3g},{most:.0f}"


def main(flags: LargeTeam) -> None:
    """Run and print."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if flags.knows is not None:
        print("planner,robots,measurements known,CPU ms a decision,MiB at its peak")
        for name in flags.planner:
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                print(pool.apply(decision, (name, flags.agents, flags.knows, flags.seed)), flush=True)
        return
    print("planner,robots,decisions,measurements,CPU s (compiling included),ms a decision,most MiB")
    for name in flags.planner:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            print(pool.apply(run, (name, flags.agents, flags.budget, flags.seed)), flush=True)


if __name__ == "__main__":
    try:
        main(tyro.cli(LargeTeam, prog="python -m tests.tools.large_team"))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
