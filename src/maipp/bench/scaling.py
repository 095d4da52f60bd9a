"""How the time and the memory of one decision grow with the survey: agents, measurements, grid, nodes."""

import dataclasses
import itertools
import statistics
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.bench.latency import compiled_anew, event_halves, timed_decisions
from maipp.engine import Mission, Planner, State, draw_missions, reset
from maipp.planners import make_planner
from maipp.problem import params_of, shape_of
from maipp.scenario import Scenario
from maipp.typing import Float

# Standard deviation of the turn at each measurement, radians: about as crooked as the routes of the planners here.
_TURN = 0.9


def walks(rng: np.random.Generator, agents: int, count: int, interval: float) -> Float[np.ndarray, "m c 2"]:
    """Measured positions of agents that set out together and wander over the unit square, `interval` apart (< 1).

    Whoever heads out of the square lingers along its border, so measurements are denser there.
    """
    position = np.broadcast_to(rng.random(2), (agents, 2))
    heading = rng.uniform(-np.pi, np.pi, agents)
    visited = np.empty((agents, count, 2))
    for i in range(count):
        heading = heading + rng.normal(0.0, _TURN, agents)
        # Straight on and mirrored at the borders: a step is less than the side, so nobody is mirrored twice.
        ahead = position + interval * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        position = np.abs(np.where(ahead > 1, 2 - ahead, ahead))
        visited[:, i] = position
    return visited


def under_way(scenario: Scenario, planner: Planner, *, seed: int, count: int) -> tuple[Mission, State]:
    """A mission in which every agent has taken `count` measurements, told them, and is due now.

    The domain is the unit square. One roadmap serves all agents: drawing a hundred takes longer than what is timed.
    """
    alone = scenario.replace(agents=1)
    drawn = draw_missions(alone, seed=seed, instances=1, planner=planner)
    m = scenario.agents
    mission = jax.tree.map(lambda a: a[0], drawn)
    start = jnp.repeat(mission.start, m, axis=0)
    roadmap = jax.tree.map(lambda a: jnp.repeat(jnp.asarray(a), m, axis=0), mission.roadmap)
    mission = dataclasses.replace(mission, shape=shape_of(scenario), params=params_of(scenario), start=start)
    if roadmap is not None:
        mission = eqx.tree_at(lambda m: m.roadmap, mission, roadmap)
    state = reset(planner, mission)
    rng = np.random.default_rng(seed)
    interval = scenario.measurement_interval
    visited = walks(rng, m, count, interval)
    here = visited[:, -1] if roadmap is None else np.asarray(roadmap.nodes[0])[rng.integers(scenario.nodes, size=m)]
    real = state.time.dtype
    x = state.measurement_x.at[:, :count].set(jnp.asarray(visited, real))
    y = state.measurement_y.at[:, :count].set(jax.vmap(mission.field)(x[:, :count]))
    travelled = jnp.full(m, count * interval, real)
    instants = jnp.asarray(interval * np.arange(1, count + 1), real)
    known = jnp.broadcast_to(jnp.arange(state.known.shape[-1]) < count, state.known.shape)
    return mission, eqx.tree_at(
        lambda s: (
            *(s.time, s.leg, s.departure, s.arrival, s.odometer, s.taken),
            *(s.measurement_x, s.measurement_y, s.measurement_time, s.known),
        ),
        state,
        (
            *(travelled[0], jnp.broadcast_to(jnp.asarray(here, real)[:, None], state.leg.shape)),
            *(travelled, travelled, travelled, jnp.full(m, count, jnp.int32)),
            *(x, y, state.measurement_time.at[:, :count].set(instants), known),
        ),
    )


PLANNERS = ("shared-greedy", "receding-horizon", "intent-paths")

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
