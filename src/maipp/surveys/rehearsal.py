"""What a team can expect of a survey: the mission simulated on many possible fields, or on a map of the user's."""

import dataclasses
import hashlib
import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from maipp.bench.provenance import SIMULATION, code_digest, planner_fingerprint
from maipp.bench.sweep.dealing import HERE, Where, run_sweep
from maipp.bench.sweep.jobs import Job, digest
from maipp.engine import Mission, State, run_missions
from maipp.engine.area_found import area_found
from maipp.engine.finite import refuse_non_finite
from maipp.engine.score import BeliefScore, moments_of, score_belief, taken_by
from maipp.foresight import ForesightName, make_foresight
from maipp.foresight.map_scores import map_scores
from maipp.kept import kept
from maipp.problem import shape_of
from maipp.surveys.drawn_fields import drawn_fields
from maipp.surveys.expected_mission import draw
from maipp.surveys.mission_file import MissionFile, Rehearsal
from maipp.surveys.raster_field import raster_field
from maipp.surveys.standardise import PreparedSurvey, prepare
from maipp.typing import Array, Float

# Mixed into the seed, so that the planners share no key with the starts and the drawn fields.
_PLANNER_STREAM = 0xFFFFFFFF

# Of a rehearsed planner whose belief is refitted under way.
REFITTED = ", refitted"


class Outcome(eqx.Module):
    """How finished missions went; every array has the missions' axis. Standardised values, domain units."""

    trace: Float[Array, "*b"]  # Tr(P) over the predicted high-interest area
    trace_before: Float[Array, "*b"]  # the same by the old samples alone
    rmse: Float[Array, "*b"]  # error of the predicted mean over the area
    rmse_before: Float[Array, "*b"]
    found: Float[Array, "*b"]  # share of the true high-interest area whose predicted mean reaches the threshold
    found_before: Float[Array, "*b"]  # NaN where the field has no high-interest area
    distance: Float[Array, "*b"]  # travelled by the team
    longest: Float[Array, "*b"]  # time until the last robot stopped


@dataclass(frozen=True, eq=False)
class RehearsedTeam:
    """The rehearsals of one planner with one size of team, one value per field; lengths metres, errors in the unit."""

    planner: str
    robots: int
    trace: Float[np.ndarray, " f"]
    trace_before: Float[np.ndarray, " f"]
    rmse: Float[np.ndarray, " f"]
    rmse_before: Float[np.ndarray, " f"]
    found: Float[np.ndarray, " f"]  # 0 to 1; NaN where nothing is of high interest
    found_before: Float[np.ndarray, " f"]
    distance: Float[np.ndarray, " f"]  # of the team
    minutes: Float[np.ndarray, " f"]  # until the last robot stopped
    # Of a foresight's map and of the belief's intervals, by the names of `MapScores.values`; empty: none was asked.
    maps: dict[str, Float[np.ndarray, " f"]] = field(default_factory=dict)

    @property
    def trace_share(self) -> Float[np.ndarray, " f"]:
        """Tr(P) as a share of what it was before the survey."""
        return self.trace / np.maximum(self.trace_before, 1e-12)


@dataclass(frozen=True, eq=False)
class RehearsalResult:
    """All rehearsed teams, planners in the order given, teams from the smallest."""

    survey: MissionFile
    teams: tuple[RehearsedTeam, ...]
    fields: int
    on: str  # "drawn fields" or the raster's path
    warnings: tuple[str, ...]
    foresight: str | None = None  # whose map is scored beside the belief's


# Rehearses a team on fields (a pytree with a leading axis), so many of them, from a seed: the parts of an `Outcome` at
# the end of the survey.
Refitted = Callable[[PreparedSurvey, Any, int, int], dict[str, Any]]


def with_robots(survey: MissionFile, count: int) -> MissionFile:
    """The survey with the first `count` robots; beyond those that it has, the last one is copied."""
    robots = list(survey.robots[:count])
    while len(robots) < count:
        name, taken = f"robot-{len(robots) + 1}", [robot.name for robot in robots]
        while name in taken:
            name += "-more"
        robots.append(dataclasses.replace(robots[-1], name=name))
    return dataclasses.replace(survey, robots=tuple(robots))


def rehearse(
    survey: MissionFile,
    *,
    planners: Sequence[str] = (),
    robots: Sequence[int] = (),
    rehearsal: Rehearsal | None = None,
    seed: int | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    refitted: Refitted | None = None,
    foresight: ForesightName | None = None,
    where: Where = HERE,
    note: Callable[[str], None] = lambda line: None,
) -> RehearsalResult:
    """The mission simulated for every planner and size of team on the same fields.

    Left out, `planners` is the survey's and `robots` all from one to its own. Drawn fields are the same for all, so
    results can be paired. On a raster the rehearsals differ in the planner's randomness only. `progress` is called with
    what is run, the number of runs done and of all. With `refitted` each team is rehearsed once more by it, with the
    kernel refitted under way, and fields are drawn with length scales as uncertain as the refits take them to be.
    With a `foresight` the map that it draws of the same measurements is scored too, and the intervals of both maps.
    Each planner and size of team is a job of the processes or the cluster that `where` names (`run_sweep`).
    Raises `InputError` for what makes a run impossible.
    """
    if refitted is not None:
        survey = dataclasses.replace(survey, kernel=dataclasses.replace(survey.kernel, adapt=True))
    rehearsal = rehearsal or survey.rehearsal
    seed = survey.seed if seed is None else seed
    planners = tuple(dict.fromkeys(planners or (survey.planner,)))
    counts = tuple(sorted(set(robots or range(1, len(survey.robots) + 1))))
    every = [(name, count) for name in planners for count in counts]
    asked = [TeamJob(survey, name, count, every[0], rehearsal, seed, refitted, foresight) for name, count in every]
    for job in asked:
        job.check()
    jobs: list[Job] = [*asked]
    teams: list[list[RehearsedTeam]] = [[] for _ in jobs]
    left = len(jobs)

    def begun(number: int) -> None:
        if progress is not None:
            progress(jobs[number].words, len(jobs) - left, len(jobs))

    def keep(number: int, found: list[RehearsedTeam]) -> None:
        nonlocal left
        teams[number], left = found, left - 1

    run_sweep(jobs, keep, where=where, begun=begun, note=note)
    if progress is not None:
        progress("done", len(jobs), len(jobs))
    on = "drawn fields" if rehearsal.raster is None else str(rehearsal.raster)
    flat = tuple(team for found in teams for team in found)
    name, count = every[0]
    warnings = prepare(with_robots(survey, count), planner=name).warnings
    return RehearsalResult(survey, flat, rehearsal.fields, on, warnings, foresight)


@dataclass(frozen=True, eq=False)
class TeamJob:
    """The rehearsals of one planner and size of team, as a job of a sweep."""

    survey: MissionFile
    planner: str
    count: int
    first: tuple[str, int]  # planner and size of the team whose area the fields are drawn in
    rehearsal: Rehearsal
    seed: int
    refitted: Refitted | None
    foresight: ForesightName | None

    @property
    def key(self) -> str:
        """A digest of what decides the result."""
        return digest(self.made_by)

    @property
    def kind(self) -> Hashable:
        """Planner and shape, which set the compiled programs."""
        return self.planner, shape_of(self._prepared(self.planner, self.count).scenario)

    @property
    def words(self) -> str:
        """Planner and number of robots."""
        return f"{self.planner}, {self.count} robot{'s' if self.count > 1 else ''}"

    @property
    def made_by(self) -> Mapping[str, Any]:
        """The mission as it is prepared here, the question, and the code and libraries that answer it."""
        prepared = self._prepared(self.planner, self.count)
        samples = prepared.prior_x, prepared.prior_y, prepared.prior_noise
        raster = b"" if self.rehearsal.raster is None else self.rehearsal.raster.read_bytes()
        return {
            "mission": hashlib.sha256(
                json.dumps(prepared.scenario.to_dict()).encode()
                + b"".join(np.asarray(each, np.float64).tobytes() for each in samples)
                + raster
            ).hexdigest(),
            "team": [self.planner, self.count, *self.first],
            "fields": [self.rehearsal.fields, self.seed, self.refitted is not None, self.foresight],
            "planner": planner_fingerprint(prepared.make_planner()),
            "code": code_digest((*SIMULATION, "maipp.planners", "maipp.surveys", "maipp.live", "maipp.foresight")),
        }

    def check(self) -> None:
        """Raise `InputError` for what makes the run impossible, before any work."""
        self._prepared(self.planner, self.count).make_planner()
        if (self.planner, self.count) == self.first:  # one look at the map is enough for all teams
            self._relief(self._prepared(*self.first))

    def _relief(self, first: PreparedSurvey) -> Any:
        """The map that stands for the truth; None where fields are drawn."""
        rehearsal = self.rehearsal
        if rehearsal.raster is None:
            return None
        return raster_field(first, rehearsal.raster, rehearsal.value, rehearsal.crs, rehearsal.at)

    def _prepared(self, planner: str, count: int) -> PreparedSurvey:
        return prepare(with_robots(self.survey, count), planner=planner)

    def compute(self) -> list[RehearsedTeam]:
        """The team, and the same with the kernel refitted where that is asked."""
        rehearsal, seed = self.rehearsal, self.seed
        prepared, first = self._prepared(self.planner, self.count), self._prepared(*self.first)
        planner = prepared.make_planner()
        key = jax.random.fold_in(jax.random.key(seed), _PLANNER_STREAM)
        relief = self._relief(first)
        if relief is not None:
            missions = draw(prepared, planner, seed=seed, instances=1, trials=rehearsal.fields, field=relief)
        else:
            spread = 0.0 if self.refitted is None or first.adapt is None else first.adapt.scale_spread
            fields = drawn_fields(first, rehearsal.fields, seed, spread)
            missions = _on_fields(draw(prepared, planner, seed=seed, instances=rehearsal.fields), fields)
        states = run_missions(planner, missions, key)
        fixed: Outcome = jax.device_get(outcomes(missions, states))
        team = _in_units(prepared, self.planner, self.count, fixed)
        if self.foresight is not None:
            model = make_foresight(self.foresight, prepared.scenario)
            maps = map_scores(model, missions, states).values(self.foresight)
            maps = {name: np.asarray(value, np.float64) for name, value in maps.items()}
            error = f"{self.foresight}_rmse"
            team = dataclasses.replace(team, maps=maps | {error: prepared.frame.to_user_std(maps[error])})
        if self.refitted is None:
            return [team]
        found = self.refitted(prepared, missions.field, rehearsal.fields, seed)
        before = {name: getattr(fixed, name) for name in ("trace_before", "rmse_before", "found_before")}
        outcome = Outcome(**jax.tree.map(jnp.asarray, found | before))
        return [team, _in_units(prepared, self.planner + REFITTED, self.count, outcome)]


def _on_fields(missions: Mission, fields: Any) -> Mission:
    """The missions, mission i on field i."""
    truth = jax.jit(jax.vmap(lambda field, grid: field(grid)))(fields, missions.grid)
    return dataclasses.replace(missions, field=fields, truth=truth)


@kept
def outcomes(missions: Mission, states: State) -> Outcome:
    """The outcomes of finished missions, one after the other to keep the memory of one."""
    return lax.map(lambda pair: _outcome(*pair), (missions, states))


def _outcome(mission: Mission, state: State) -> Outcome:
    moments, threshold = moments_of(mission, state), mission.params.threshold

    def at(time: float) -> tuple[BeliefScore, Array]:
        then = score_belief(mission, moments, taken_by(state, time))
        area = area_found(mission.truth >= threshold, then.mean >= threshold, mission.inside)
        return then, jnp.asarray(area.both / area.true)  # NaN where there is none

    (before, found_before), (after, found) = at(-1.0), at(jnp.inf)
    reached = jnp.where(jnp.isfinite(state.route_time), state.route_time, 0.0)
    return Outcome(
        trace=after.trace,
        trace_before=before.trace,
        rmse=after.rmse,
        rmse_before=before.rmse,
        found=found,
        found_before=found_before,
        distance=jnp.sum(state.odometer),
        longest=jnp.max(reached),
    )


def _in_units(prepared: PreparedSurvey, planner: str, count: int, outcome: Any) -> RehearsedTeam:
    frame = prepared.frame
    values = {each.name: np.asarray(getattr(outcome, each.name), np.float64) for each in dataclasses.fields(Outcome)}
    shares = ("found", "found_before")  # NaN where the field has no high-interest area
    numbers = {key: value for key, value in values.items() if key not in shares}
    refuse_non_finite(numbers, lambda index: f"rehearsal of {planner} with {count} robots, field {index}")
    distance, longest = values.pop("distance"), values.pop("longest")
    for key in ("rmse", "rmse_before"):
        values[key] = frame.to_user_std(values[key])
    if prepared.survey.threshold is None:
        for key in shares:
            values[key] = np.full_like(values[key], np.nan)
    minutes = longest * prepared.seconds_per_time / 60.0
    return RehearsedTeam(planner, count, distance=distance * frame.scale, minutes=minutes, maps={}, **values)
