"""Tr(P) as a function of the distance that each agent has travelled."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
from jax import lax

from maipp.bench.output import csv_text
from maipp.bench.tables import Row
from maipp.engine import Mission, State, run_missions
from maipp.engine.finite import instance_and_trial, refuse_non_finite
from maipp.engine.observe import time_tolerance
from maipp.engine.score import trace_over_time
from maipp.scenario import Scenario
from maipp.typing import Array, Float


class Curve(NamedTuple):
    """What one planner leaves on the way."""

    row: Row
    distance: Float[np.ndarray, " d"]  # travelled by each agent, domain units
    trace: Float[np.ndarray, "instances d"]  # Tr(P) of the pooled belief, mean over trials


def trace_curve(row: Row, scenario: Scenario, *, instances: int, seed: int) -> Curve:
    """The curve of a row, from its missions: one per instance.

    All agents have speed 1 here, so the distance that an agent on its way has travelled is the time.
    """
    planner, missions = row.drawn(scenario, instances=instances, seed=seed)
    states = run_missions(planner, missions, jax.random.key(seed))
    distance = np.arange(scenario.measurements_per_agent + 1) * scenario.measurement_interval
    # Times are sums of float32 legs: each instant includes all of its own measurements.
    traces = _traces(missions, states, distance + time_tolerance(np.asarray(scenario.speeds)))
    refuse_non_finite({"Tr(P)": traces}, instance_and_trial(1))
    return Curve(row, distance, np.asarray(traces, np.float64))


@jax.jit
def _traces(missions: Mission, states: State, times: Float[Array, " d"]) -> Float[Array, "instances d"]:
    return lax.map(lambda pair: trace_over_time(pair[0], pair[1], times), (missions, states))


def curves_csv(curves: Sequence[Curve]) -> str:
    """Tidy CSV: a line for each row, instance and distance."""
    return csv_text(
        ("row", "planner", "options", "instance", "distance", "trace"),
        (
            (curve.row.name, curve.row.planner, curve.row.typed_options, instance, f"{d:g}", f"{np.float32(trace)}")
            for curve in curves
            for instance, traces in enumerate(curve.trace)
            for d, trace in zip(curve.distance, traces, strict=True)
        ),
    )
