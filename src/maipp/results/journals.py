"""From the journal of a live survey to what it took home."""

import dataclasses
import math
import os
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from maipp.belief import PriorSamples
from maipp.engine.episode import AgentRecord, Episode, EpisodeMetrics
from maipp.foresight import Foresight
from maipp.geo import GeoReference
from maipp.live.kernel import interest_under, under
from maipp.live.measurements import Slots
from maipp.live.recorded_survey import RecordedSurvey, read_record
from maipp.live.robot_state import GONE, STOPPED, WAITING, RobotState
from maipp.results.taken import Out, Taken, TakenRobot, TakenSample, from_home
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey
from maipp.typing import Float

_UNIX = 1e8  # s: an epoch above is Unix time (1973), not a clock of the survey's own
_INSTANTS = 63  # of the curve, besides its begin: one call of what is compiled
_STOPPED = {
    "budget": "stopped: budget used up",
    "planner": "stopped: nothing worth going to",
    "no-go": "stopped: no way out of the no-go zones",
    "home": "stopped: at home",
}


def taken_live(path: str | os.PathLike[str], mission: PreparedSurvey | Scenario | None = None) -> Taken:
    """What the live survey of a journal took home so far. Raises `InputError` as `read_record`."""
    return taken_from(read_record(path, mission), str(path))


def taken_from(record: RecordedSurvey, source: str) -> Taken:
    """What a live survey took home so far; `source` is where its record is from."""
    place, slots = record.place, record.measurements.slots()
    epoch, site, robots = place.units.epoch, place.site, _robots(record)
    date = datetime.fromtimestamp(epoch, UTC).date().isoformat() if _UNIX < epoch < 1e11 else None
    notes = []
    if record.torn:
        notes.append(
            f"the last {record.torn} bytes of the journal are no whole line, and left out: a line is being written, or "
            "a kill cut it short"
        )
    kernel = record.measurements.kernel
    if kernel is not None and kernel.aspect > 1:
        notes.append(
            "the field was found to have two length scales: the map is by these, the uncertainty left and the report's "
            "frames are by their mean"
        )
    return Taken(
        source=Path(source).name,
        live=True,
        title=site.title,
        date=date,
        planner=record.planner,
        episode=_episode(record, slots),
        seconds_per_time=place.units.seconds_per_time,
        crs=site.crs,
        area=None if site.area is None else np.array(site.area),
        no_go=tuple(map(np.array, site.no_go)),
        threshold_given=site.threshold,
        truth_known=False,
        samples=tuple(_samples(record)),
        robots=robots,
        belief=partial(_belief, record),
        notes=tuple(notes),
    )


def _belief(
    record: RecordedSurvey, points: Float[np.ndarray, "p 2"], foresight: Foresight | None = None
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """The belief in the values of the episode, which are standardised by the kernel that was found."""
    mean, std = record.belief(points, foresight)
    level, scale = (np.array(number, mean.dtype) for number in record.measurements.standard)
    return (mean - level) / scale, std / scale


def _samples(record: RecordedSurvey) -> list[TakenSample]:
    judged, samples = record.measurements.verdicts(), []
    verdicts = dict(zip(judged.samples, judged.verdicts, strict=True))
    for report, sample, reason in record.measurements.everything:
        event, answer = record.reports[report]
        verdict = verdicts.get(sample)
        surprise = answer.get("surprise") if verdict is None else verdict.surprise
        out: Any = "empty" if sample.stray and reason not in (None, "withdrawn") else reason
        kept_out: Out | None = out
        numbers = event.time, *event.position, event.value
        samples.append(TakenSample(report, event.robot, *numbers, surprise, kept_out))
    return samples


def _robots(record: RecordedSurvey) -> tuple[TakenRobot, ...]:
    scenario, rows = record.place.scenario, []
    ends = scenario.ends_from(record.place.starts) if scenario.homes else ((),) * scenario.agents
    interval, everything = scenario.measurement_interval, record.measurements.everything
    for number, robot in enumerate(record.robots):
        last = max(record.fixes[number], key=lambda fix: fix.time)
        position = np.array([last.x, last.y])
        away, home = from_home(position, ends[number], interval)
        if away is not None and robot.status == STOPPED and (robot.answer or {}).get("reason") == "home":
            home = True
        rows.append(
            TakenRobot(
                name=robot.name,
                budget=float(robot.budget),
                reserve=float(scenario.reserves[number]),
                travelled=_travelled(record, number),
                status=_status(robot),
                time=last.time,
                position=position,
                samples=sum(sample.robot == number for _, sample, _ in everything),
                away=away,
                home=home,
            )
        )
    return tuple(rows)


def _status(robot: RobotState) -> str:
    if robot.status == WAITING:
        return "only measured, and asked for no way" if robot.measured else "never reported that it set out"
    if robot.status == GONE:
        return "reported gone"
    if robot.status == STOPPED:
        return _STOPPED.get((robot.answer or {}).get("reason", ""), "stopped")
    return "on its way home" if robot.homeward else "on its way"


def _travelled(record: RecordedSurvey, number: int) -> float:
    """Way travelled, as the odometer said last; of a robot that tells none, through the places that it reported."""
    robot = record.robots[number]
    told = [way for _, way in robot.measured if way >= 0]
    if told:
        return max(robot.odometer, *told)
    later = sorted(fix for fix in record.fixes[number] if fix.time > robot.time)
    way = np.array([robot.position, *((fix.x, fix.y) for fix in later)])
    since = float(np.hypot(*np.diff(way, axis=0).T).sum())
    return robot.odometer + since


def _episode(record: RecordedSurvey, slots: Slots) -> Episode:
    """The record of the live survey, as of a planned one: routes as they were reported, and the samples that count."""
    place = record.place
    counts = [int((slots.mask & (slots.by == number)).sum()) for number in range(len(record.robots))]
    scenario, frame, mission, kernel = place.scenario, place.units.frame, record.mission, record.measurements.kernel
    if kernel is not None:  # the record's values are standardised by it, as the slots' are
        guess, (level, scale) = record.measurements.guess, record.measurements.standard
        mission = under(mission, guess, kernel)
        frame = (frame or GeoReference.of_domain(scenario.extent)).shifted(level, scale)
        threshold, beta = interest_under(scenario, level, scale, place.beta_follows)
        found = {"length_scale": kernel.length_scale, "noise": kernel.noise / scale**2}
        scenario = scenario.replace(**found, threshold=threshold, beta=beta)
    if max(counts) > scenario.measurements_per_agent:  # a record has no more slots than budgets allow
        least = (max(counts) + 0.5) * scenario.measurement_interval
        scenario = scenario.replace(budget=tuple(max(budget, least) for budget in scenario.budgets))
    agents = tuple(_agent(record, slots, number, counts) for number in range(len(record.robots)))
    prior = None
    if mission.prior is not None:
        x, y, noise = mission.prior.x, mission.prior.y, mission.prior.noise
        prior = PriorSamples(np.asarray(x), np.asarray(y), None if noise is None else np.asarray(noise))
    episode = Episode(
        scenario=scenario,
        planner=record.planner,
        options={},
        seed=record.seed,
        index=0,
        agents=agents,
        truth=np.zeros(scenario.grid_points, slots.x.dtype),  # nobody's
        inside=np.asarray(mission.inside),
        message_bytes=0,
        reference=frame,
        prior=prior,
    )
    return dataclasses.replace(episode, recorded=_metrics(episode))


def _agent(record: RecordedSurvey, slots: Slots, number: int, counts: list[int]) -> AgentRecord:
    robot, real = record.robots[number], slots.x.dtype
    fixes = np.array(sorted(record.fixes[number], key=lambda fix: fix.time), np.float64)
    moved = np.append(True, (np.diff(fixes[:, 1:], axis=0) != 0).any(axis=1) | (np.diff(fixes[:, 0]) > 0))
    own = slots.mask & (slots.by == number)
    return AgentRecord(
        start=fixes[0, 1:].astype(real),
        budget=float(robot.budget),
        speed=float(robot.speed),
        distance=_travelled(record, number),
        decisions=robot.arrivals,
        route=fixes[moved, 1:].astype(real),
        route_time=fixes[moved, 0].astype(real),
        measurement_x=slots.x[own],
        measurement_y=slots.y[own],
        measurement_time=slots.time[own],
        known=np.array(counts),
    )


def _metrics(episode: Episode) -> EpisodeMetrics:
    """What can be known without the truth: Tr(P) at the end, and at no more instants than are drawn."""
    instants = episode.measurement_instants()
    chosen = np.unique(np.linspace(0, max(len(instants) - 1, 0), _INSTANTS).round().astype(int))
    times = np.append(np.zeros(1, instants.dtype), instants[chosen] if len(instants) else instants)
    trace = episode.beliefs(np.append(-1.0, times[1:])).trace  # the first before anything was measured
    return EpisodeMetrics(
        trace=float(trace[-1]),
        own_trace=np.full(len(episode.agents), trace[-1]),
        true_trace=math.nan,
        rmse=math.nan,
        mutual_information=math.nan,
        curve_time=times,
        curve_trace=trace,
    )
