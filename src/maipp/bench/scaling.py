"""How the time and the memory of one decision grow with the survey: agents, measurements, grid, nodes.

`maipp benchmark scaling` leaves what is measured here, and the belief's error (`belief_error`), as a JSON file with
everything, two CSV files, a page of tables, and a figure.
"""

import dataclasses
import itertools
import json
import math
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from maipp.bench.belief_error import BeliefError, walks
from maipp.bench.command import machines
from maipp.bench.drawings import draw_scaling, save_figure
from maipp.bench.frame import grouped
from maipp.bench.page import markdown
from maipp.bench.provenance import machine, versions
from maipp.bench.tidy_csv import csv_text
from maipp.engine import Mission, Planner, State, draw_missions, reset
from maipp.engine.decision_time import compiled_anew, event_halves, timed_decisions
from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.planners import make_planner
from maipp.problem import params_of, shape_of
from maipp.scenario import Scenario


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
    known_until = jnp.full_like(state.known_until, (count + 0.5) * interval)
    return mission, eqx.tree_at(
        lambda s: (
            *(s.time, s.leg, s.departure, s.arrival, s.odometer, s.taken),
            *(s.measurement_x, s.measurement_y, s.measurement_time, s.known_until),
        ),
        state,
        (
            *(travelled[0], jnp.broadcast_to(jnp.asarray(here, real)[:, None], state.leg.shape)),
            *(travelled, travelled, travelled, jnp.full(m, count, jnp.int32)),
            *(x, y, state.measurement_time.at[:, :count].set(instants), known_until),
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
    frame, found = pd.DataFrame(costs, columns=Cost._fields), []
    for name, own in grouped(frame, "planner"):
        for axis, line in grouped(own, "axis"):
            if axis in AXES and len({*line[axis]}) > 1:
                numbers = line.sort_values(by=axis, kind="stable")
                size, duration, memory = (np.log(numbers[key].to_numpy()) for key in (axis, "decision_ms", "memory_mb"))
                end = (duration[-1] - duration[-2]) / (size[-1] - size[-2])
                whole, held = (np.polyfit(size, values, 1)[0] for values in (duration, memory))
                found.append(Growth(name, axis, float(whole), float(end), float(held)))
    return found


class ScalingResults(NamedTuple):
    """What has been measured, and with which settings."""

    settings: dict[str, Any]
    costs: list[Cost]
    errors: list[BeliefError]


def write_json(results: ScalingResults, folder: Path) -> None:
    """Write all results so far to `scaling.json`; JSON has no NaN, which becomes null."""
    content = {
        "settings": results.settings,
        "versions": versions(),
        "machine": machine(),
        "costs": [cost._asdict() for cost in results.costs],
        "growth": [line._asdict() for line in growth(results.costs)],
        "errors": [_replaced(error._asdict(), math.isnan, None) for error in results.errors],
    }
    write_atomic(folder / "scaling.json", json.dumps(content, indent=1, allow_nan=False) + "\n")


def read_json(folder: Path, settings: dict[str, Any]) -> ScalingResults:
    """The results that `folder` holds of a run with the same settings, versions and machine; else none.

    Raises `InputError` for a file that is no such record.
    """
    path = folder / "scaling.json"
    none = ScalingResults(settings, [], [])
    if not path.exists():
        return none
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        here = (settings, versions(), machine())
        if tuple(content[key] for key in ("settings", "versions", "machine")) != here:
            return none
        costs = [Cost(**row) for row in content["costs"]]
        errors = [BeliefError(**_replaced(row, lambda value: value is None, math.nan)) for row in content["errors"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: not a record of this benchmark ({error}); remove it, or give another --out"
        ) from None
    return ScalingResults(settings, costs, errors)


def _replaced(row: dict[str, Any], which: Callable[[Any], bool], by: Any) -> dict[str, Any]:
    return {key: by if which(value) else value for key, value in row.items()}


def add_missing(
    kept: list[Any], wanted: Iterable[tuple], measure: Callable[..., Any], told: Callable[[Any], None]
) -> None:
    """Measure at all points of which nothing is kept yet, and keep what comes; `told` hears of each when it is kept."""
    there = {one.point for one in kept}
    for point in wanted:
        if point not in there:
            kept.append(measure(*point))
            told(kept[-1])


def write_report(results: ScalingResults, folder: Path) -> list[Path]:
    """Write tables and figure of finished results; gives the paths written."""
    written = [folder / name for name in ("scaling.json", "scaling.csv", "errors.csv", "scaling.md", "scaling.png")]
    costs = pd.DataFrame(results.costs, columns=Cost._fields)
    write_json(results, folder)
    write_atomic(written[1], csv_text(costs))
    write_atomic(written[2], csv_text(pd.DataFrame(results.errors, columns=BeliefError._fields)))
    write_atomic(written[3], to_markdown(results))
    save_figure(draw_scaling(costs), written[4])
    return written


_GROWTHS = {
    "planner": "`{planner}`",
    "axis": "{axis}",
    "time": "{time:.2f}",
    "time, last two sizes": "{time_end:.2f}",
    "memory": "{memory:.2f}",
}
_COSTS = {
    "planner": "`{planner}`",
    "varied": "{axis}",
    **{name: f"{{{name}}}" for name in BASE},
    "ms": "{decision_ms:.1f}",
    "p95": "{p95_ms:.1f}",
    "compile s": "{compile_s:.1f}",
    "MB": "{memory_mb:.1f}",
    "state MB": "{state_mb:.1f}",
}
_ERRORS = {
    "measurements": "{measurements:g}",
    "interval": "{interval:g}",
    "length scale": "{length_scale:g}",
    "surveys": "{surveys:g}",
    "Tr(P)": "{trace:.4g}",
    "error": "{error:.3f} %",
    "se": "{error_se:.3f} %",
    "worst": "{error_worst:.3f} %",
    "mean": "{mean_worst:.2g}",
    "variance": "{variance_worst:.2g}",
}


def to_markdown(results: ScalingResults) -> str:
    """The tables: exponents, the largest size, every point, and the errors of the belief."""
    parts = [
        "# Scaling",
        f"{machines((machine(), versions()))}. Times are processor time of one decision (hear, observe, decide), "
        "medians; memory is what the compiled decision needs at its peak.",
        "Cost goes as the size to the power of:",
        markdown(pd.DataFrame(growth(results.costs), columns=Growth._fields), _GROWTHS),
        "Every size:",
        markdown(pd.DataFrame(results.costs, columns=Cost._fields), _COSTS),
    ]
    if results.errors:
        errors = pd.DataFrame(results.errors, columns=BeliefError._fields)
        percent = {name: 100 * errors[name] for name in ("error", "error_se", "error_worst")}
        parts += [
            "Error of the belief against the exact one in float64 (se: over surveys; worst: of any survey; mean and "
            "variance: the worst of any survey and grid point):",
            markdown(errors.assign(**percent), _ERRORS),
        ]
    return "\n\n".join(parts) + "\n"
