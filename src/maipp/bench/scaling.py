"""How the time and the memory of one decision grow with the survey: agents, measurements, grid, nodes."""

import dataclasses
import itertools
import statistics
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import numpy as np

from maipp.bench.latency import compiled_anew, event_halves, timed_decisions
from maipp.bench.mid_survey import under_way
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
    def point(self) -> tuple[str, str, Size]:
        """What was measured, as `points` has it."""
        return self.planner, self.axis, Size(self.agents, self.measurements, self.grid, self.nodes)


def points(
    planners: Iterable[str],
    axes: Mapping[str, Iterable[int]] = AXES,
    base: Mapping[str, int] = BASE,
    largest: Mapping[str, int] | None = LARGEST,
) -> Iterator[tuple[str, str, Size]]:
    """What there is to measure, as planner, axis and size: every point of every axis, the other sizes at their base.

    Where it is given, the largest size comes last. Planners without roadmaps do not depend on the nodes.
    """
    sizes = []
    for axis, values in axes.items():
        for value in values:
            size = Size(**{**base, axis: value})
            # Every agent takes as many: the nearest multiple of their number.
            each = max(1, round(size.measurements / size.agents))
            sizes.append((axis, dataclasses.replace(size, measurements=each * size.agents)))
    if largest is not None:
        sizes.append(("largest", Size(**largest)))
    for axis, size in sizes:
        for name in planners:
            if axis != "nodes" or make_planner(name, Scenario()).uses_roadmap:
                yield name, axis, size


def measure(
    name: str, axis: str, size: Size, *, length_scale: float, capacity: int | None, least: int, seed: int
) -> Cost:
    """The cost of a decision of one planner at one size, at least `least` of them timed."""
    scenario = size.scenario(length_scale, capacity)
    planner = make_planner(name, scenario)
    mission, state = under_way(scenario, planner, seed=seed, count=size.measurements // size.agents)
    held = sum(leaf.nbytes for leaf in jax.tree.leaves((mission, state)))
    decide, proceed = event_halves(planner.on(mission.problem))
    key = jax.random.key(seed)
    begun = time.process_time()
    compiled, decide = compiled_anew(decide, mission, state, key)
    compile_s = time.process_time() - begun
    # In the first round nobody has told anything yet.
    every = timed_decisions((decide, proceed), mission, state, key, time.process_time)
    seconds = list(itertools.islice(every, size.agents + least))
    milliseconds = [1e3 * one for one in seconds[size.agents :]]
    needs = compiled.memory_analysis()
    assert needs is not None  # every backend that maipp runs on tells
    return Cost(
        planner=name,
        axis=axis,
        **vars(size),
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


def growth(costs: Sequence[Cost]) -> list[Growth]:
    """Exponents fitted by least squares to the logarithms, for each planner and axis with two sizes or more."""
    found = []
    for name, axis in itertools.product(dict.fromkeys(c.planner for c in costs), dict.fromkeys(c.axis for c in costs)):
        line = [c for c in costs if (c.planner, c.axis) == (name, axis) and axis in AXES]
        numbers = sorted((getattr(c, axis), c.decision_ms, c.memory_mb) for c in line)
        if len({size for size, *_ in numbers}) > 1:
            size, duration, memory = np.log(numbers).T
            end = (duration[-1] - duration[-2]) / (size[-1] - size[-2])
            slopes = (np.polyfit(size, values, 1)[0] for values in (duration, memory))
            time_slope, memory_slope = map(float, slopes)
            found.append(Growth(name, axis, time_slope, float(end), memory_slope))
    return found
