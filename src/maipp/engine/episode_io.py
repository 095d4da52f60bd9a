"""Episodes as files: the exact record as JSON (docs/episode.md), waypoints and measurements as CSV."""

import csv
import io
import json
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from maipp.belief import PriorSamples
from maipp.engine.episode import AgentRecord, Episode, EpisodeMetrics, shortest
from maipp.engine.episode_keys import SCHEMA, AgentKeys, EpisodeKeys, MetricKeys, PlannerKeys
from maipp.engine.episode_numbers import numbers, wholes
from maipp.engine.episode_place import read_reference
from maipp.files import read_text, write_atomic
from maipp.records import Value, pretty, read_json
from maipp.scenario import Scenario

StrPath = str | os.PathLike[str]


def write_episode(episode: Episode, path: StrPath) -> None:
    """Write the record as JSON; every number reads back as it is. Raises `InputError` where it cannot be written."""
    write_atomic(path, dump_episode(episode))


def dump_episode(episode: Episode) -> str:
    """The record as JSON text, with the metrics."""
    side, metrics, reference = episode.scenario.grid, episode.metrics, episode.reference
    record = {
        "schema": SCHEMA,
        "precision": str(episode.truth.dtype),
        "planner": {"name": episode.planner, "options": dict(episode.options)},
        "seed": episode.seed,
        "index": episode.index,
        "scenario": episode.scenario.to_dict(),
        "mapping": None if reference is None else reference.to_dict(),
        "metrics": {
            "trace": metrics.trace,
            "own_trace": _plain(metrics.own_trace),
            "true_trace": metrics.true_trace,
            "rmse": metrics.rmse,
            "mutual_information": metrics.mutual_information,
            "curve": {"time": _plain(metrics.curve_time), "trace": _plain(metrics.curve_trace)},
        },
        "message_bytes": episode.message_bytes,
        **({} if episode.prior is None else {"prior": _prior(episode.prior)}),
        **({"expected": True} if episode.expected else {}),
        "agents": [_agent(agent) for agent in episode.agents],
        "truth": _plain(episode.truth.reshape(side, side)),
        "outside": np.flatnonzero(~episode.inside).tolist(),
    }
    return pretty(record) + "\n"


def read_episode(path: StrPath) -> Episode:
    """The episode in a file that `write_episode` wrote, with its metrics as recorded.

    Raises `InputError` naming the file and the key of what is missing, of the wrong type or contradictory.
    """
    return parse_episode(read_text(path, "episode", "an episode.json"), source=str(path))


def parse_episode(text: str, *, source: str = "episode") -> Episode:
    """The episode in JSON text; errors name `source`."""
    record = read_json(text, source)
    record.part(EpisodeKeys, "schema")
    real = np.dtype(record.part(EpisodeKeys, "precision"))
    scenario = _scenario(record["scenario"])
    side, team = scenario.grid, scenario.agents
    agents = tuple(_read_agent(agent, scenario, real) for agent in record["agents"].items(count=team))
    _check_known(record["agents"], agents)
    metrics = record["metrics"]
    time = numbers(metrics["curve"]["time"], real, empty="it has at least the time 0")
    inside = np.ones(side * side, bool)
    inside[wholes(record["outside"], side * side - 1)] = False
    return Episode(
        scenario=scenario,
        planner=record["planner"].part(PlannerKeys, "name"),
        options=_options(record["planner"]["options"]),
        seed=record.part(EpisodeKeys, "seed"),
        index=record.part(EpisodeKeys, "index"),
        agents=agents,
        truth=np.stack([numbers(row, real, side) for row in record["truth"].items(count=side)]).reshape(-1),
        inside=inside,
        message_bytes=record.part(EpisodeKeys, "message_bytes"),
        reference=read_reference(record["mapping"], scenario),
        prior=_read_prior(record["prior"], real) if "prior" in record.mapping() else None,
        expected=record.part(EpisodeKeys, "expected") if "expected" in record.mapping() else False,
        recorded=EpisodeMetrics(
            trace=metrics.part(MetricKeys, "trace"),
            own_trace=numbers(metrics["own_trace"], real, team),
            true_trace=metrics.part(MetricKeys, "true_trace"),
            rmse=metrics.part(MetricKeys, "rmse"),
            mutual_information=metrics.part(MetricKeys, "mutual_information"),
            curve_time=time,
            curve_trace=numbers(metrics["curve"]["trace"], real, len(time)),
        ),
    )


def waypoints_csv(episode: Episode) -> str:
    """Route vertices as CSV: agent, order, x, y, time, distance travelled; the user's coordinates where there are any.

    The last column is `distance_m` where it is known how long a domain unit is on the ground; else `distance` in the
    file's units, or `distance_domain` in domain units where a unit of x and one of y differ in length.
    """
    there = episode.geo
    scale, heading = there.metres_per_unit, "distance_m"
    if scale is None:
        scale, heading = there.length_scale, "distance"
    rows = []
    for index, agent in enumerate(episode.agents):
        lengths = np.linalg.norm(np.diff(agent.route.astype(np.float64), axis=0), axis=-1)
        distance = np.append(0.0, np.cumsum(lengths)) * (scale or 1.0)
        places = zip(there.to_user(agent.route), agent.route_time, distance, strict=True)
        rows += [(index, order, *place, time, length) for order, (place, time, length) in enumerate(places)]
    return _csv(("agent", "order", there.x_name, there.y_name, "time", heading if scale else "distance_domain"), rows)


def measurements_csv(episode: Episode) -> str:
    """Measurements as CSV: agent, order, x, y, value, time; the user's coordinates and units where there are any."""
    there = episode.geo
    rows = []
    for index, agent in enumerate(episode.agents):
        places, values = there.to_user(agent.measurement_x), there.to_user_values(agent.measurement_y)
        taken = zip(places, values, agent.measurement_time, strict=True)
        rows += [(index, order, *place, value, time) for order, (place, value, time) in enumerate(taken)]
    return _csv(("agent", "order", there.x_name, there.y_name, there.value_name, "time"), rows)


def _csv(header: tuple[str, ...], rows: Iterable[tuple[Any, ...]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    # A file whose columns are called "time" or both alike would give a table whose columns cannot be told apart.
    writer.writerow(name if header.count(name) == 1 else f"{name}_{i}" for i, name in enumerate(header))
    for agent, order, *rest in rows:
        # Ten digits: more than float32 holds, and centimetres in any map projection.
        writer.writerow([agent, order, *(f"{shortest(number):.10g}" for number in rest)])
    return text.getvalue()


def _agent(agent: AgentRecord) -> dict[str, Any]:
    places, spots = _plain(agent.route.T), _plain(agent.measurement_x.T)
    return {
        "start": _plain(agent.start),
        "budget": agent.budget,
        "speed": agent.speed,
        "distance": agent.distance,
        "decisions": agent.decisions,
        "route": {"x": places[0], "y": places[1], "time": _plain(agent.route_time)},
        "measurements": {
            "x": spots[0],
            "y": spots[1],
            "value": _plain(agent.measurement_y),
            "time": _plain(agent.measurement_time),
        },
        "known": agent.known.tolist(),
        **({} if agent.stopped_by is None else {"stopped_by": agent.stopped_by}),
    }


def _prior(prior: PriorSamples) -> dict[str, Any]:
    places = _plain(np.asarray(prior.x).T)
    noise = None if prior.noise is None else _plain(np.asarray(prior.noise))
    return {"x": places[0], "y": places[1], "value": _plain(np.asarray(prior.y)), "noise": noise}


def _plain(array: np.ndarray) -> list:
    """Nested lists of the shortest decimals that read back as these numbers."""
    return [_plain(row) if array.ndim > 1 else shortest(row) for row in array]


def _options(key: Value) -> dict[str, Any]:
    """The planner's options, which are as the planner wrote them: any JSON."""
    options = key.mapping()
    try:
        json.dumps(options, allow_nan=False)
    except ValueError:  # Python reads NaN and 1e999, and would not write them again
        key.wrong("holds a number that is not finite")
    return options


def _scenario(key: Value) -> Scenario:
    for option in Scenario.__dataclass_fields__:
        key[option]  # a default in place of what was left out would replay another survey
    return key.make(Scenario.create, key.mapping())


def _read_agent(key: Value, scenario: Scenario, real: np.dtype) -> AgentRecord:
    route, measured = key["route"], key["measurements"]
    route_time = numbers(route["time"], real, empty="a route has at least its start")
    measurement_time = numbers(measured["time"], real)
    if len(measurement_time) > scenario.measurements_per_agent:
        allowed = scenario.measurements_per_agent
        measured["time"].wrong(f"has {len(measurement_time)} entries; the scenario allows {allowed} measurements")
    for there, times in ((route, route_time), (measured, measurement_time)):
        if (np.diff(times) < 0).any():
            there["time"].wrong("goes back; times must not fall")

    def points(of: Value, count: int) -> np.ndarray:
        return np.stack([numbers(of[axis], real, count) for axis in "xy"], axis=-1)

    return AgentRecord(
        start=numbers(key["start"], real, 2),
        budget=key.part(AgentKeys, "budget"),
        speed=key.part(AgentKeys, "speed"),
        distance=key.part(AgentKeys, "distance"),
        decisions=key.part(AgentKeys, "decisions"),
        route=points(route, len(route_time)),
        route_time=route_time,
        measurement_x=points(measured, len(measurement_time)),
        measurement_y=numbers(measured["value"], real, len(measurement_time)),
        measurement_time=measurement_time,
        known=wholes(key["known"], count=scenario.agents),
        stopped_by=key.part(AgentKeys, "stopped_by") if "stopped_by" in key.mapping() else None,
    )


def _read_prior(key: Value, real: np.dtype) -> PriorSamples:
    values = numbers(key["value"], real, empty="leave prior out where there are no samples")
    count = len(values)
    noise = None if key["noise"].value is None else numbers(key["noise"], real, count)
    if noise is not None and (noise < 0).any():
        key["noise"].wrong("goes below 0; it is the variance of a sample's noise")
    return PriorSamples(np.stack([numbers(key[name], real, count) for name in "xy"], axis=-1), values, noise)


def _check_known(key: Value, agents: tuple[AgentRecord, ...]) -> None:
    for i, agent in enumerate(agents):
        for j, count in enumerate(agent.known):
            if count > len(agents[j].measurement_y):
                measured = len(agents[j].measurement_y)
                key.at(f"[{i}].known[{j}]").wrong(f"is {count}, but agent {j} took {measured} measurements")
