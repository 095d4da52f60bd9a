"""How the time and the memory of one decision grow with the survey: agents, measurements, grid, nodes."""

import dataclasses
import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from maipp.benchmarks.mid_survey import under_way
from maipp.engine.advance import advance
from maipp.engine.rollout import due_decision
from maipp.planners import make_planner
from maipp.scenario import Scenario

PLANNERS = ("shared-greedy", "receding-horizon", "ti-star")

# The axes, and where on each of them the others are varied.
AXES: dict[str, tuple[int, ...]] = {
    "agents": (3, 10, 30, 100),
    "measurements": (50, 150, 500, 1500, 5000),
    "grid": (30, 50, 70, 100),
    "nodes": (200, 400, 800),
}
BASE = {"agents": 10, "measurements": 500, "grid": 30, "nodes": 200}

# The largest team and the most measurements together, at the grid and the roadmaps of the paper.
LARGEST = {"agents": 100, "measurements": 5000, "grid": 30, "nodes": 200}

# Budget left, in measurements: planners that look ahead see as far as they can.
_TO_COME = 5
_INTERVAL = 0.2


@dataclass(frozen=True)
class Size:
    """One point of an axis: the scenario's sizes."""

    agents: int
    measurements: int
    grid: int
    nodes: int

    def scenario(self, length_scale: float, capacity: int | None) -> Scenario:
        """The survey of this size; `capacity` replaces the scenario's own."""
        each = self.measurements // self.agents
        given = {} if capacity is None else {"belief_capacity": capacity}
        return Scenario.create(
            agents=self.agents,
            budget=_INTERVAL * (each + _TO_COME),
            measurement_interval=_INTERVAL,
            length_scale=length_scale,
            grid=self.grid,
            nodes=self.nodes,
            neighbours=min(20, self.nodes - 1),
            **given,
        )


class Cost(NamedTuple):
    """What one decision costs at one point of an axis."""

    planner: str
    axis: str  # what is varied, or "largest"
    agents: int
    measurements: int  # that the agent knows
    grid: int  # points per side
    nodes: int  # of each roadmap
    decision_ms: float  # median processor time of one decision: hear, observe, decide
    p95_ms: float
    decisions: int  # timed
    compile_s: float  # processor time of tracing and compiling, apart
    memory_mb: float  # what the compiled decision needs at its peak: its temporaries and its result
    state_mb: float  # arrays of the mission and of its state

    @property
    def size(self) -> Size:
        """The point that was measured."""
        return Size(self.agents, self.measurements, self.grid, self.nodes)


def sizes(axes: dict[str, tuple[int, ...]], base: dict[str, int]) -> Iterator[tuple[str, Size]]:
    """Every point of every axis, the other sizes at their base."""
    for axis, values in axes.items():
        for value in values:
            size = Size(**(base | {axis: value}))
            # Every agent takes as many: the nearest multiple of their number.
            each = max(1, round(size.measurements / size.agents))
            yield axis, dataclasses.replace(size, measurements=each * size.agents)


def measure(
    name: str, axis: str, size: Size, *, length_scale: float, capacity: int | None, least: int, seed: int
) -> Cost:
    """The cost of a decision of one planner at one size, at least `least` of them timed."""
    scenario = size.scenario(length_scale, capacity)
    planner = make_planner(name, scenario)
    count = size.measurements // size.agents
    mission, state = under_way(scenario, planner, seed=seed, count=count)
    arrays, static = eqx.partition(planner.on(mission.problem), eqx.is_array)
    key = jax.random.key(seed)
    begun = time.process_time()
    compiled = jax.jit(lambda arrays, *inputs: due_decision(eqx.combine(arrays, static), *inputs))
    compiled = compiled.lower(arrays, mission, state, key).compile()
    compile_s = time.process_time() - begun
    proceed = jax.jit(lambda arrays, *inputs: advance(eqx.combine(arrays, static), *inputs))
    milliseconds: list[float] = []
    # In the first round nobody has told anything yet.
    for event in range(size.agents + least):
        jax.block_until_ready(state)
        begun = time.process_time()
        decided = jax.block_until_ready(compiled(arrays, mission, state, key))
        if event >= size.agents:
            milliseconds.append(1e3 * (time.process_time() - begun))
        state = proceed(arrays, mission, *decided)
        if not bool(state.active.any()):
            break
    needs = compiled.memory_analysis()
    assert needs is not None  # every backend that maipp runs on tells
    held = sum(leaf.nbytes for leaf in jax.tree.leaves((mission, state)))
    return Cost(
        planner=name,
        axis=axis,
        agents=size.agents,
        measurements=count * size.agents,
        grid=size.grid,
        nodes=size.nodes,
        decision_ms=statistics.median(milliseconds),
        p95_ms=float(np.percentile(milliseconds, 95)),
        decisions=len(milliseconds),
        compile_s=compile_s,
        memory_mb=(needs.temp_size_in_bytes + needs.output_size_in_bytes) / 2**20,
        state_mb=held / 2**20,
    )


class Growth(NamedTuple):
    """How a cost of a planner grows along an axis: it goes as the size to this power."""

    planner: str
    axis: str
    time: float  # exponent of the decision time, fitted over the whole axis
    time_end: float  # the same between the two largest sizes
    memory: float  # exponent of the memory, over the whole axis


def growth(costs: list[Cost]) -> list[Growth]:
    """Exponents fitted by least squares to the logarithms, for each planner and axis with two sizes or more."""
    found = []
    for name in dict.fromkeys(cost.planner for cost in costs):
        for axis in dict.fromkeys(cost.axis for cost in costs):
            line = sorted((c for c in costs if (c.planner, c.axis) == (name, axis)), key=lambda c: getattr(c, axis, 0))
            if axis not in AXES or len({getattr(c, axis) for c in line}) < 2:
                continue
            size = [math.log(getattr(c, axis)) for c in line]
            duration, memory = ([math.log(getattr(c, k)) for c in line] for k in ("decision_ms", "memory_mb"))
            end = (duration[-1] - duration[-2]) / (size[-1] - size[-2])
            slopes = (float(np.polyfit(size, values, 1)[0]) for values in (duration, memory))
            time_slope, memory_slope = slopes
            found.append(Growth(name, axis, time_slope, end, memory_slope))
    return found


def scaling(
    planners: tuple[str, ...] = PLANNERS,
    *,
    axes: dict[str, tuple[int, ...]] | None = None,
    base: dict[str, int] | None = None,
    largest: dict[str, int] | None = LARGEST,
    length_scale: float = 0.25,
    capacity: int | None = None,
    least: int = 30,
    seed: int = 0,
    done: tuple[Cost, ...] = (),
    report: Callable[[Cost], None] = lambda cost: None,
) -> list[Cost]:
    """The costs of each planner's decisions along the axes and, where given, at the largest size.

    `capacity` replaces the scenario's `belief_capacity`; at least `least` decisions are timed at each point. Points of
    which `done` has the cost are not measured again. `report` is called with every new cost as it comes.
    """
    points = list(sizes(AXES if axes is None else axes, BASE if base is None else base))
    if largest is not None:
        points.append(("largest", Size(**largest)))
    costs = list(done)
    measured = {(cost.planner, cost.axis, cost.size) for cost in done}
    for axis, size in points:
        for name in planners:
            if (name, axis, size) in measured:
                continue
            if axis == "nodes" and not make_planner(name, Scenario()).uses_roadmap:
                continue
            cost = measure(name, axis, size, length_scale=length_scale, capacity=capacity, least=least, seed=seed)
            costs.append(cost)
            report(cost)
    return costs
