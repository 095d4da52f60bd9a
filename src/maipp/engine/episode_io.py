"""Episodes as files: the exact record as JSON (docs/episode.md), waypoints and measurements as CSV."""

import csv
import io
import json
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from maipp.belief import PriorSamples
from maipp.engine.checked_json import Key, pretty
from maipp.engine.episode import AgentRecord, Episode, EpisodeMetrics, shortest
from maipp.engine.episode_place import read_reference
from maipp.engine.state import REASONS
from maipp.errors import InputError
from maipp.files import read_text, write_atomic
from maipp.scenario import Scenario, ScenarioError
from maipp.seeds import LARGEST_SEED

SCHEMA = "maipp.episode/1"

_PRECISIONS = ("float32", "float64")
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
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{source}:{error.lineno}: not JSON, or cut short: {error.msg}") from None
    except (RecursionError, ValueError):  # a number of 5000 digits is a ValueError
        raise InputError(f"{source}: not an episode: nested too deeply, or a number too long") from None
    record = Key(source, "", content)
    if (schema := record["schema"].text()) != SCHEMA:
        record["schema"].wrong(f"{schema!r} is not a schema that this version reads; it reads {SCHEMA!r}")
    precision = record["precision"].text()
    if precision not in _PRECISIONS:
        record["precision"].wrong(f"{precision!r} is neither of {', '.join(_PRECISIONS)}")
    real = np.dtype(precision)
    scenario = _scenario(record["scenario"])
    side, team = scenario.grid, scenario.agents
    agents = tuple(_read_agent(agent, scenario, real) for agent in record["agents"].items(team))
    _check_known(record["agents"], agents)
    metrics = record["metrics"]
    time = metrics["curve"]["time"].numbers(real)
    if not len(time):
        metrics["curve"]["time"].wrong("is empty; it has at least the time 0")
    outside = record["outside"].wholes(below=side * side)
    inside = np.ones(side * side, bool)
    inside[outside] = False
    return Episode(
        scenario=scenario,
        planner=record["planner"]["name"].text(),
        options=_options(record["planner"]["options"]),
        seed=record["seed"].whole(LARGEST_SEED + 1),
        index=record["index"].whole(),
        agents=agents,
        truth=np.stack([row.numbers(real, side) for row in record["truth"].items(side)]).reshape(-1),
        inside=inside,
        message_bytes=record["message_bytes"].whole(),
        reference=read_reference(record["mapping"], scenario),
        prior=_read_prior(record["prior"], real) if "prior" in record.mapping() else None,
        recorded=EpisodeMetrics(
            trace=metrics["trace"].number(),
            own_trace=metrics["own_trace"].numbers(real, team),
            true_trace=metrics["true_trace"].number(),
            rmse=metrics["rmse"].number(),
            mutual_information=metrics["mutual_information"].number(),
            curve_time=time,
            curve_trace=metrics["curve"]["trace"].numbers(real, len(time)),
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
    for agent, order, *numbers in rows:
        # Ten digits: more than float32 holds, and centimetres in any map projection.
        writer.writerow([agent, order, *(f"{shortest(number):.10g}" for number in numbers)])
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


def _options(key: Key) -> dict[str, Any]:
    """The planner's options, which are as the planner wrote them: any JSON."""
    options = key.mapping()
    try:
        json.dumps(options, allow_nan=False)
    except ValueError:  # Python reads NaN and 1e999, and would not write them again
        key.wrong("holds a number that is not finite")
    return options


def _scenario(key: Key) -> Scenario:
    for option in Scenario.__dataclass_fields__:
        key[option]  # a default in place of what was left out would replay another survey
    try:
        return Scenario.from_dict(key.mapping())
    except ScenarioError as error:
        Key(key.source, f"{key.name}.{error.key}", None).wrong(error.problem)


def _read_agent(key: Key, scenario: Scenario, real: np.dtype) -> AgentRecord:
    route, measured = key["route"], key["measurements"]
    route_time, measurement_time = route["time"].numbers(real), measured["time"].numbers(real)
    if not len(route_time):
        route["time"].wrong("is empty; a route has at least its start")
    if len(measurement_time) > scenario.measurements_per_agent:
        allowed = scenario.measurements_per_agent
        measured["time"].wrong(f"has {len(measurement_time)} entries; the scenario allows {allowed} measurements")
    for name, times in (("route.time", route_time), ("measurements.time", measurement_time)):
        if (np.diff(times) < 0).any():
            Key(key.source, f"{key.name}.{name}", None).wrong("goes back; times must not fall")
    budget, speed = key["budget"].number(), key["speed"].number()
    for name, value in (("budget", budget), ("speed", speed)):
        if value <= 0:
            key[name].wrong(f"is {value}; it must be above 0")

    def points(of: Key, count: int) -> np.ndarray:
        return np.stack([of["x"].numbers(real, count), of["y"].numbers(real, count)], axis=-1)

    return AgentRecord(
        start=key["start"].numbers(real, 2),
        budget=budget,
        speed=speed,
        distance=key["distance"].number(),
        decisions=key["decisions"].whole(),
        route=points(route, len(route_time)),
        route_time=route_time,
        measurement_x=points(measured, len(measurement_time)),
        measurement_y=measured["value"].numbers(real, len(measurement_time)),
        measurement_time=measurement_time,
        known=key["known"].wholes(scenario.agents),
        stopped_by=_read_reason(key["stopped_by"]) if "stopped_by" in key.mapping() else None,
    )


def _read_reason(key: Key) -> str:
    reason = key.text()
    if reason not in REASONS:
        key.wrong(f"{reason!r} is no reason to stop; there are {', '.join(filter(None, REASONS))}")
    return reason


def _read_prior(key: Key, real: np.dtype) -> PriorSamples:
    values = key["value"].numbers(real)
    count = len(values)
    if not count:
        key["value"].wrong("is empty; leave prior out where there are no samples")
    noise = None if key["noise"].value is None else key["noise"].numbers(real, count)
    if noise is not None and (noise < 0).any():
        key["noise"].wrong("goes below 0; it is the variance of a sample's noise")
    return PriorSamples(np.stack([key[name].numbers(real, count) for name in "xy"], axis=-1), values, noise)


def _check_known(key: Key, agents: tuple[AgentRecord, ...]) -> None:
    for i, agent in enumerate(agents):
        for j, count in enumerate(agent.known):
            if count > len(agents[j].measurement_y):
                where = Key(key.source, f"{key.name}[{i}].known[{j}]", None)
                where.wrong(f"is {count}, but agent {j} took {len(agents[j].measurement_y)} measurements")
