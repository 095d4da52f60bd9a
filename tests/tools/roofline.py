"""`python -m tests.tools.roofline`: where the time of one decision goes, against the arithmetic and memory it needs.

Decisions are taken in the middle of missions, on one core, alone and in a batch. Beside the time stand the operations
(counted in the traced program, loops as often as they run), the share of the core's rate that they come to, and the
memory that the compiled program touches at least once. Prints rows of docs/evidence/speed.csv.
"""

import csv
import math
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import tyro

from maipp.devices import use_one_core

_SECTION = "Where a decision's time goes"

# Equations that move numbers and make none.
_MOVES = {
    *("broadcast_in_dim", "reshape", "squeeze", "transpose", "concatenate", "pad", "iota", "copy", "rev"),
    *("slice", "dynamic_slice", "dynamic_update_slice", "gather", "convert_element_type", "stop_gradient"),
}


@dataclass(frozen=True)
class Roofline:
    """Time decisions on one core, and count what they compute."""

    planner: tuple[str, ...] = ("receding-horizon", "intent-search", "intent-paths")
    """planners to time"""
    agents: tuple[int, ...] = (3, 10)
    """sizes of the team"""
    batch: tuple[int, ...] = (1, 16)
    """missions that decide together"""
    repeat: int = 30
    """times that each is timed"""
    seed: int = 0
    """of the worlds"""


class Cost(NamedTuple):
    """What a compiled program takes."""

    best: float  # seconds
    median: float
    operations: float  # one for each number that is made; two for each product and sum of a matrix product
    memory: float  # bytes of its arguments, its temporaries and its result


def cost(function: Callable[..., Any], arguments: tuple[Any, ...], repeat: int) -> Cost:
    """CPU time, operations and memory of a function, compilation excluded."""
    import jax

    program = jax.jit(function).lower(*arguments).compile()
    jax.block_until_ready(program(*arguments))
    seconds = []
    for _ in range(repeat):
        begun = time.process_time()
        jax.block_until_ready(program(*arguments))
        seconds.append(time.process_time() - begun)
    needs: Any = program.memory_analysis()
    memory = needs.argument_size_in_bytes + needs.temp_size_in_bytes + needs.output_size_in_bytes
    return Cost(min(seconds), statistics.median(seconds), operations(function, *arguments), memory)


def operations(function: Callable[..., Any], *arguments: Any) -> float:
    """Operations of a function: of what its results depend on, loops of unknown length once, the dearer branch."""
    import jax
    from jax.interpreters import partial_eval

    traced = jax.make_jaxpr(function)(*arguments).jaxpr
    used, _ = partial_eval.dce_jaxpr(traced, [True] * len(traced.outvars))
    return _counted(used)


def _counted(jaxpr: Any) -> float:
    total = 0.0
    for equation in jaxpr.eqns:
        inner = [_counted(each) for each in _inside(equation.params)]
        name = equation.primitive.name
        made: Any = equation.outvars[0].aval if equation.outvars else None
        if name == "scan":
            total += equation.params["length"] * sum(inner)
        elif name == "cond":
            total += max(inner)
        elif inner:
            total += sum(inner)
        elif name == "dot_general":
            (summed, _), _ = equation.params["dimension_numbers"]
            total += 2 * made.size * math.prod(equation.invars[0].aval.shape[axis] for axis in summed)
        elif name == "cholesky":
            total += made.size * made.shape[-1] / 3
        elif name == "triangular_solve":
            total += made.size * equation.invars[0].aval.shape[-1]
        elif made is not None and name not in _MOVES:
            total += made.size
    return total


def _inside(params: dict[str, Any]) -> Iterator[Any]:
    """The programs that an equation runs."""
    for key, value in params.items():
        if key == "jvp_jaxpr_fun":
            continue
        for each in value if isinstance(value, tuple | list) else (value,):
            closed = getattr(each, "jaxpr", each)
            if hasattr(closed, "eqns"):
                yield closed


def rates() -> tuple[float, float]:
    """What the core reaches: operations a second of a matrix product of 512, bytes a second read and written."""
    import jax.numpy as jnp

    square, long = jnp.ones((512, 512)), jnp.ones(2**20)
    product = cost(lambda a: a @ a, (square,), 50).best
    return 2 * 512**3 / product, 2 * long.nbytes / cost(lambda a: a + 1.0, (long,), 50).best


def underway(name: str, agents: int, batch: int, seed: int) -> tuple[Any, Any, Any]:
    """The planner, missions half-way, and their states; leading axis of the batch."""
    import jax

    from maipp.engine import draw_missions, reset
    from maipp.engine.rollout import step
    from maipp.planners import make_planner
    from maipp.scenario import Scenario

    scenario = Scenario.create(agents=agents)
    made = make_planner(name, scenario)
    missions = draw_missions(scenario, seed=seed, instances=batch, planner=made)
    planner = made.on(jax.tree.map(lambda a: a[0], missions.problem))
    states = jax.vmap(lambda mission: reset(planner, mission))(missions)
    go = jax.jit(jax.vmap(lambda mission, state: step(planner, mission, state, jax.random.key(seed))))
    for _ in range(6 * agents):
        states = go(missions, states)
    return planner, missions, states


def decision(planner: Any, batch: int) -> Callable[..., Any]:
    """What is timed: one decision of every mission, from hearing to the message."""
    import jax

    from maipp.engine.rollout import due_decision

    def decide(mission: Any, state: Any) -> Any:
        return due_decision(planner, mission, state, jax.random.key(0))[2]

    if batch > 1:
        return jax.vmap(decide)
    return lambda missions, states: decide(*jax.tree.map(lambda a: a[0], (missions, states)))


def policy_stages(missions: Any, states: Any, planner: Any) -> dict[str, tuple[Callable[..., Any], tuple[Any, ...]]]:
    """The parts of a decision of `intent-paths`, each as a function and its arguments; batch of one."""
    import jax
    import jax.numpy as jnp

    from maipp.engine.observe import begin_event

    mission, state = jax.tree.map(lambda a: a[0], (missions, states))
    sampler, key = planner.sampler, jax.random.key(0)
    observation = jax.jit(lambda m, s: begin_event(m, s)[2])(mission, state)
    memory = jax.tree.map(lambda a: a[observation.agent], state.memory)
    nobody = jnp.zeros(observation.roadmap.nodes.shape[0])

    def situated(seen: Any) -> Any:
        return sampler.agent_state(seen, seen.at_nodes, nobody)

    def sample(where: Any, insight: Any) -> Any:
        return sampler.sample(key, where, insight, paths=planner.paths, steps=planner.steps, distinct=True)

    where = jax.jit(situated)(observation)
    insight = jax.jit(lambda where, memory: sampler.look(where, memory))(where, memory.trajectory)
    paths = jax.jit(sample)(where, insight)
    network, view = sampler.policy, insight.view
    return {
        "belief": (lambda m, s: begin_event(m, s)[2].belief, (mission, state)),
        "encoder": (lambda f, e: network.encode(f, e), (view.features, view.encoding)),
        "attention": (lambda x: network.encoder[0].attention(x), (insight.prepared.embeddings,)),
        "paths": (sample, (where, insight)),
        "ranking": (lambda *given: planner._scores(*given), (observation, where, paths)),
    }


def main(flags: Roofline) -> None:
    """Time, count and print."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    use_one_core()
    rate, bandwidth = rates()
    write = csv.writer(sys.stdout, lineterminator="\n").writerow
    command = "python -m tests.tools.roofline"

    def row(what: str, measure: str, at: str, value: float, n: int) -> None:
        write([_SECTION, what, measure, at, f"{value:.3g}", "", n, flags.seed, "", "", "", command])

    def rows(what: str, found: Cost, decisions: int) -> None:
        measure = "one decision on one core"
        row(what, measure, "ms (median)", 1e3 * found.median / decisions, flags.repeat)
        row(what, measure, "ms (best)", 1e3 * found.best / decisions, flags.repeat)
        row(what, measure, "MFLOP", found.operations / 1e6 / decisions, flags.repeat)
        row(what, measure, "ms at the core's rate", 1e3 * found.operations / rate / decisions, flags.repeat)
        row(what, measure, "MB", found.memory / 1e6 / decisions, flags.repeat)
        row(what, measure, "ms at its bandwidth", 1e3 * found.memory / bandwidth / decisions, flags.repeat)

    row("matrix product of 512, GFLOP/s", "what the core reaches", "value", rate / 1e9, 50)
    row("4 MB read and written, GB/s", "what the core reaches", "value", bandwidth / 1e9, 50)
    for name in flags.planner:
        for agents in flags.agents:
            for batch in flags.batch:
                planner, *given = underway(name, agents, batch, flags.seed)
                found = cost(decision(planner, batch), tuple(given), flags.repeat)
                rows(f"{name}, {agents} agents, batch of {batch}", found, batch)
                if name == "intent-paths" and batch == 1:
                    for stage, (function, arguments) in policy_stages(*given, planner).items():
                        rows(f"{name}, {agents} agents: {stage}", cost(function, arguments, flags.repeat), 1)
                sys.stdout.flush()


if __name__ == "__main__":
    main(tyro.cli(Roofline, prog="python -m tests.tools.roofline"))
