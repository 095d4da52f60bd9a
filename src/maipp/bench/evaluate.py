"""How good a planner is: held-out missions run and scored, with everything needed to run them again."""

import dataclasses
import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32
from maipp.bench.provenance import machine, planner_fingerprint, versions
from maipp.devices import missions_devices
from maipp.engine import Mission, Planner, draw_missions, run_missions
from maipp.engine.decision_time import DecisionTime, decision_time
from maipp.engine.finite import instance_and_trial, refuse_non_finite
from maipp.engine.rollout import lanes_at_most
from maipp.engine.score import score_missions
from maipp.errors import InputError
from maipp.fields.gp_field import draw_fields
from maipp.fields.raster import Raster, read_field
from maipp.foresight import Foresight, ForesightName, make_foresight
from maipp.foresight.map_scores import map_scores
from maipp.planners.any_planner import AnyPlanner, given_planner
from maipp.planners.options import values_of
from maipp.problem import Shape, params_of, shape_of
from maipp.scenario import Scenario
from maipp.seeds import check_seed
from maipp.typing import Float, Key

# Blocks (missions that all devices step at once) between two calls of `progress`: what an interrupt can lose. At
# the end of each part lanes have nothing to take up, so parts are long.
_BLOCKS_PER_PART = 40

# Mixed into the seed for the planner's randomness, so that it shares no key with the instances 0, 1, 2...
_PLANNER_STREAM = 0xFFFFFFFF
# Mixed into the seed for the fields, so that they share no key with an instance, nor with the planner.
_FIELD_STREAM = 0xFFFFFFFE

Progress = Callable[[int, int], None]  # missions done, missions in all


class Summary(NamedTuple):
    """One metric over all missions."""

    mean: float
    std: float | None  # over trials, of the mean over instances (the paper's "std", ddof 1); None for one trial
    se: float | None  # standard error of the mean, over instances; None for one instance


@dataclass(frozen=True)
class Evaluation:
    """A planner's results on one scenario."""

    scenario: Scenario
    planner: str
    options: Mapping[str, Any]  # every option with its value
    instances: int
    first: int  # number of the first instance: they are counted from 0
    trials: int
    seed: int
    # Per metric: the fields of `Metrics`, and with a map those of `MapScores`.
    values: Mapping[str, Float[np.ndarray, "instances trials"]]
    message_bytes: int  # what an agent sends at each decision
    decision_ms: DecisionTime | None  # None where it was not asked for
    wall_s: float  # all of it: drawing, compiling, running, scoring, timing
    machine: Mapping[str, Any]
    versions: Mapping[str, str]
    fingerprint: str  # of the code, weights and libraries that made it; empty for a planner whose code has no file

    @property
    def summary(self) -> dict[str, Summary]:
        """Mean, spread over trials and standard error of every metric."""
        return {metric: summarise(values) for metric, values in self.values.items()}

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings, lists and None, ready for JSON; per-mission values are `[instance][trial]`.

        Raises InputError for a value that is not a finite number, with its instance and trial.
        """
        refuse_values(self.values)
        return {
            "planner": self.planner,
            "options": {name: plain(value) for name, value in self.options.items()},
            "scenario": self.scenario.to_dict(),
            "seed": self.seed,
            "instances": self.instances,
            "first": self.first,
            "trials": self.trials,
            "summary": {metric: plain(row._asdict()) for metric, row in self.summary.items()},
            "message_bytes": self.message_bytes,
            "decision_ms": None if self.decision_ms is None else plain(self.decision_ms._asdict()),
            "wall_s": self.wall_s,
            "versions": dict(self.versions),
            "fingerprint": self.fingerprint,
            "machine": dict(self.machine),
            "values": {metric: values.tolist() for metric, values in self.values.items()},
        }


def refuse_values(values: Mapping[str, Float[np.ndarray, "instances trials"]]) -> None:
    """Raise InputError for a metric that is not a finite number, with its instance and trial."""
    for metric, rows in values.items():
        refuse_non_finite({metric: rows.reshape(-1)}, instance_and_trial(rows.shape[1]))


def summarise(values: Float[np.ndarray, "instances trials"]) -> Summary:
    """Mean over all, standard deviation over trials of the instance mean, standard error over instances."""
    instances, trials = values.shape
    std = float(values.mean(axis=0).std(ddof=1)) if trials > 1 else None
    se = float(values.mean(axis=1).std(ddof=1) / math.sqrt(instances)) if instances > 1 else None
    return Summary(float(values.mean()), std, se)


def evaluate(
    scenario: Scenario,
    planner: AnyPlanner,
    options: Mapping[str, object] | None = None,
    *,
    instances: int = 30,
    first: int = 0,
    trials: int = 10,
    seed: int = 0,
    timing: bool = True,
    shape: Shape | None = None,
    field: Raster | None = None,
    map: ForesightName | None = None,
    progress: Progress | None = None,
) -> Evaluation:
    """The planner's results on `instances * trials` missions (Yang et al. 2023, Sec. V: 30 x 10).

    `planner` is a name, `path/to/file.py:Class`, a subclass of `Planner`, a planner, or a function: either of
    `(scenario, **options)` that makes a planner, or of `(key, observation, memory)` that decides. The instances are
    those of the seed from number `first` on, so that one evaluation can be made in parts (`merged`).

    Instance i of a seed is the same world for every planner, so results can be paired; a trial draws fresh roadmaps
    and fresh randomness of the planner. The instances are `draw_missions(seed=seed)`: training must never draw from
    this family of keys, or the evaluation is no longer held out. A scenario with a field file takes the file's shape
    as its extent, and its instances differ in the start only; `field` is that file where it is not to be read with the
    defaults of `read_field`. `timing=False` saves one compilation. `map` names a foresight whose map is scored as well,
    `FORESIGHT_rmse`, and how often the truth lies in its 68 and 95 % intervals, `FORESIGHT_68`, and in the belief's,
    `belief_68`.

    `shape` is one that several evaluations share (`shape_of`), which are then compiled once: the numbers stay what they
    are up to rounding, missions with budgets below the largest take somewhat longer.
    Raises `InputError` for an unknown planner, a bad option, a seed out of range, or a count below one.
    """
    check_counts(instances=instances, trials=trials)
    if first < 0:
        raise InputError(f"first: {first} is the number of no instance; they are counted from 0")
    check_seed(seed)
    begun = time.perf_counter()
    if field is None and scenario.field is not None:
        field = read_field(scenario.field)
    if field is not None:
        scenario = scenario.replace(extent=field.domain)
    name, made = given_planner(planner, scenario, options)
    foresight = None if map is None else (map, make_foresight(map, scenario))
    missions = _draw(scenario, field, seed, (first, instances), trials, made, shape)
    return Evaluation(
        scenario=scenario,
        planner=name,
        options=values_of(made),
        instances=instances,
        first=first,
        trials=trials,
        seed=seed,
        values=scored(made, missions, seed, trials, progress, first=first * trials, foresight=foresight),
        message_bytes=message_bytes(made),
        decision_ms=decision_time(made, missions, planner_key(seed)) if timing else None,
        wall_s=time.perf_counter() - begun,
        machine=machine(),
        versions=versions(),
        fingerprint=fingerprint_of(made, field),
    )


def worlds_of(evaluation: Evaluation) -> tuple[Any, ...]:
    """What two evaluations have to have in common to be of the same missions."""
    return evaluation.scenario, evaluation.seed, evaluation.first, evaluation.instances


def fingerprint_of(planner: Planner, field: Raster | None = None) -> str:
    """A digest of what decides the planner's results in a field; empty where its code has no file."""
    try:
        known = planner_fingerprint(planner)
    except InputError:
        return ""
    arrays = (np.asarray(leaf) for leaf in jax.tree.leaves(field))
    known["field"] = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode("utf-8")).hexdigest()[:16]


def planner_key(seed: int) -> Key:
    """The key of the planner's randomness: none that an instance has."""
    return jax.random.fold_in(jax.random.key(seed), _PLANNER_STREAM)


def message_bytes(planner: Planner) -> int:
    """Size of one message: what an agent tells the others at each decision, in bytes."""
    arrays = (jnp.asarray(leaf) for leaf in jax.tree.leaves(planner.empty_message()))
    return sum(array.size * array.dtype.itemsize for array in arrays)


def scored(
    planner: Planner,
    missions: Mission,
    seed: int,
    trials: int,
    progress: Progress | None = None,
    *,
    first: int = 0,
    foresight: tuple[str, Foresight] | None = None,
) -> dict[str, Float[np.ndarray, "instances trials"]]:
    """Every metric of all missions, `trials` to an instance; the number of the first mission is `first`.

    They are run in parts of equal shape, so that each function is compiled once. A `foresight`, with its name, is one
    whose map is scored as well.
    """
    key, count = planner_key(seed), missions.start.shape[0]
    block = lanes_at_most(planner) * len(missions_devices())
    blocks = math.ceil(count / block)
    size = min(count, block * math.ceil(blocks / math.ceil(blocks / _BLOCKS_PER_PART)))
    parts: list[dict[str, Any]] = []
    for begin in range(0, count, size):
        index = np.minimum(np.arange(begin, begin + size), count - 1)
        part = jax.tree.map(lambda array, index=index: array[index], missions)
        states = run_missions(planner, part, key, first=first + begin)
        done = min(begin + size, count)
        metrics = vars(jax.device_get(score_missions(part, states, name=instance_and_trial(trials, first + begin))))
        if foresight is not None:
            metrics = metrics | map_scores(foresight[1], part, states).values(foresight[0])
        parts.append({name: np.asarray(values)[: done - begin] for name, values in metrics.items()})
        if progress is not None:
            progress(done, count)
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return {name: np.asarray(values, np.float64).reshape(-1, trials) for name, values in whole.items()}


def _draw(
    scenario: Scenario,
    field: Raster | None,
    seed: int,
    instances: tuple[int, int],
    trials: int,
    planner: Planner,
    shape: Shape | None,
) -> Mission:
    """The missions of an evaluation; those of scenarios that share their worlds are drawn once.

    Of the `instances` the first and how many there are.
    """
    drawn: dict[str, Any] = {"roadmaps": planner.uses_roadmap, "encodings": planner.encoding_dimensions}
    drawn |= {"seed": seed, "first": instances[0], "instances": instances[1], "trials": trials}
    if field is not None:  # its file may change between two evaluations
        return draw_missions(scenario, **drawn, field=field, shape=shape)
    worlds = Scenario.from_dict({name: value for name, value in scenario.to_dict().items() if name in _OF_WORLDS})
    missions = _draw_once(worlds, **drawn)
    params = jax.tree.map(
        lambda number, like: jnp.broadcast_to(number, like.shape), params_of(scenario), missions.params
    )
    return dataclasses.replace(missions, shape=shape or shape_of(scenario), params=params)


# What of a scenario decides which worlds are drawn.
_OF_WORLDS = (
    *("agents", "start", "extent", "grid", "obstacles", "mixture_components", "mixture_variance"),
    *("nodes", "neighbours"),
)


@lru_cache(maxsize=9)  # without roadmaps, with them, and with their encodings, each for three numbers of trials
def _draw_once(scenario: Scenario, **drawn: Any) -> Mission:
    return draw_missions(scenario, **drawn)


def prior_missions(
    scenario: Scenario, planner: Planner, seed: int, instances: int, trials: int, shape: Shape | None = None
) -> Mission:
    """A batch of `instances * trials` missions in worlds of the scenario's own prior, as where its kernel was fitted.

    All but the ground truth is as `draw_missions` draws it: that is a draw of the Gaussian process that the scenario
    describes. The instance fixes it, whatever the planner and the budget.
    """
    missions = draw_missions(scenario, seed=seed, instances=instances, trials=trials, planner=planner, shape=shape)
    kernel = Matern32(scenario.length_scale, scenario.signal_variance)
    drawn = draw_fields(jax.random.fold_in(jax.random.key(seed), _FIELD_STREAM), kernel, instances)
    fields = jax.tree.map(lambda leaf: jnp.repeat(leaf, trials, axis=0), drawn)
    truth = jax.jit(jax.vmap(lambda field, grid: field(grid)))(fields, missions.grid)
    return dataclasses.replace(missions, field=fields, truth=truth)


def check_counts(flag: str = "", **counts: int) -> None:
    """Raise InputError for a count below 1; `flag` goes before its name, such as `--`."""
    for name, count in counts.items():
        if count < 1:
            raise InputError(f"{flag}{name}: {count} is not a number of {name}; give a whole number >= 1")


def plain(value: Any) -> Any:
    """As JSON has it: tuples as lists, None for a number that it does not know, else the `repr`."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, bool | int | float | str | None) else repr(value)
