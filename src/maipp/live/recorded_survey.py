"""A live survey read back from its journal, without planner and mission file: what was measured, what counts of it."""

import dataclasses
import os
from collections.abc import Iterable
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.engine import Mission
from maipp.errors import InputError
from maipp.foresight import Foresight
from maipp.live.belief_problem import BeliefProblem, place_in, read_place
from maipp.live.belief_query import believe
from maipp.live.changes import Changes
from maipp.live.changing import proposed
from maipp.live.effects import effect, inside, taken_late
from maipp.live.events import Arrived, Change, Event, Heard, Joined, Keep, Measurement, Withdraw, read_event
from maipp.live.journal import read_journal
from maipp.live.journal_entries import read_answer, read_change
from maipp.live.measurements import MeasurementSet
from maipp.live.refits import Fits, take_up
from maipp.live.request import PROTOCOL
from maipp.live.robot_state import RobotState
from maipp.live.survey_limits import SurveyLimits
from maipp.live.world import make_gate
from maipp.records import Value
from maipp.records.kinds import Finite
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey, interest_beta
from maipp.typing import Float

# What planners announce and remember is of no use to the result, and its form only they know.
_NOTHING: tuple[Any, Any] = ((), ())


class PositionReport(NamedTuple):
    """A report of where a robot was."""

    time: float  # the scenario's time
    x: float  # domain units
    y: float


@dataclasses.dataclass(eq=False)
class RecordedSurvey:
    """What a journal holds, taken in event by event, as the live survey did."""

    place: BeliefProblem
    planner: str
    seed: int
    maipp: str  # the version that wrote it
    robots: list[RobotState]  # as they were at their last report; without messages
    fixes: list[list[PositionReport]]  # of each robot, in the order of the journal
    measurements: MeasurementSet
    reports: dict[str, tuple[Measurement, dict[str, Any]]]  # every report of a measurement, and what was answered
    torn: int  # bytes after the last whole line
    mission: Mission  # the belief's prior is in it
    ground: SurveyLimits
    changes: Changes = Changes()

    def belief(
        self, points: Float[np.ndarray, "p 2"], foresight: Foresight | None = None
    ) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
        """Mean and standard deviation at domain positions, standardised values: what `LiveSurvey.belief` answers."""
        return believe(self.mission, self.measurements, points, foresight)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the robots."""
        return tuple(robot.name for robot in self.robots)


def read_record(path: str | os.PathLike[str], mission: PreparedSurvey | Scenario | None = None) -> RecordedSurvey:
    """The live survey in a journal, which may be in use: it is neither locked nor changed.

    `mission` is for a journal of an earlier version, whose header does not hold it. Raises `InputError`, one line with
    the path, for a file that is no journal of this protocol, or damaged, and for a mission that is not the survey's.
    """
    (header, *records), torn = read_journal(path)
    numbered = ((f"{path}: line {number}", record) for number, record in enumerate(records, start=2))
    return make_record(str(path), header, numbered, torn, mission)


def make_record(
    source: str,
    header: dict[str, Any],
    records: Iterable[tuple[str, dict[str, Any]]],
    torn: int = 0,
    mission: PreparedSurvey | Scenario | None = None,
) -> RecordedSurvey:
    """The live survey of a journal's header and records, each with where it stands. Raises as `read_record`."""
    head = Value(header, source)
    protocol = header.get("journal")
    if protocol != PROTOCOL:
        raise InputError(f"{source}: a journal of the protocol {protocol!r:.60}; this version reads {PROTOCOL}")
    names, epoch = head["robots"].fit(tuple[str, ...]), head["epoch"].fit(Finite)
    if "place" in head:
        if mission is not None:
            raise InputError(f"{source}: the journal holds its own mission; leave out --mission")
        place = read_place(head["place"], epoch)
    elif mission is not None:
        place = place_in(mission, head["seed"].fit(int), epoch)
    else:
        raise InputError(f"{source}: a journal of an earlier version, without its mission; give that: --mission FILE")
    count = place.scenario.agents
    if len(names) != count or len(set(names)) != len(names):
        raise InputError(f"{source}: {len(set(names))} robots with names of their own; the mission has {count}")
    record = _begun(place, names, head, torn)
    for where, values in records:
        try:
            _take(record, Value(values, where))
        except InputError as error:
            told = str(error)
            raise InputError(told if told.startswith(where) else f"{where}: {told}") from None
    _settle(record)
    return record


def _begun(place: BeliefProblem, names: tuple[str, ...], head: Value, torn: int) -> RecordedSurvey:
    """The record of a survey in which nothing has happened."""
    scenario = place.scenario
    try:
        mission = place.mission()
    except InputError as error:
        raise InputError(f"{head.source}: line 1: place: {error}") from None
    real = np.dtype(jax.dtypes.canonicalize_dtype(float))
    gate = make_gate(mission, scenario, place.gate, place.adapt)
    rows = zip(names, place.starts, scenario.speeds, scenario.budgets, strict=True)
    return RecordedSurvey(
        place=place,
        planner=head["planner"].fit(str),
        seed=head["seed"].fit(int),
        maipp=head["maipp"].fit(str),
        robots=[RobotState(name, speed, budget, *_NOTHING, leg=start[None]) for name, start, speed, budget in rows],
        fixes=[[PositionReport(0.0, *start)] for start in place.starts.tolist()],
        measurements=MeasurementSet(len(names), place.room, real, gate),
        reports={},
        torn=torn,
        mission=mission,
        ground=SurveyLimits(scenario, place.starts, place.clearance),
    )


def _take(record: RecordedSurvey, values: Value) -> None:
    """Take in one line of a journal."""
    if "kernels" in values:
        take_up(record.measurements.fits, values["kernels"].fit(Fits))
    event: Event = read_event(values["event"].mapping(), record.names)
    if isinstance(event, Heard):
        event = dataclasses.replace(event, packed="")
    answer, state = read_answer(values["answer"]), read_change(event, values)
    inner = inside(event, record.place.units, _NOTHING, record.place.gate > 0)
    if isinstance(event, Change):
        _change(record, event, inner, state)
        return
    number = record.names.index(event.robot)
    state = taken_late(event, inner, state, record.robots[number])
    changed = effect(event, inner, (number, record.robots[number]), answer, state, _NOTHING)
    record.robots[number] = changed.robot
    if changed.sample is not None and isinstance(event, Measurement):
        record.measurements.add(changed.sample, event.id)
        record.reports[event.id] = event, answer
    if changed.decision is not None and isinstance(event, Withdraw | Keep):
        record.measurements.decide(event.measurement, changed.decision)
    if isinstance(event, Arrived | Measurement | Heard):
        record.fixes[number].append(PositionReport(inner["time"], *inner["position"].tolist()))


def _change(record: RecordedSurvey, event: Change, inner: dict[str, Any], state: dict[str, Any] | None) -> None:
    """Take in a change of the survey as a whole."""
    record.changes = proposed(event, inner, record.changes)
    if state is not None:
        record.changes = dataclasses.replace(record.changes, anchors=state["anchors"])
    if isinstance(event, Joined):
        place, time = inner["position"], inner["time"]
        told = {"leg": place[None], "latest": time, "time": time, "fixes": [(time, 0.0)]}
        record.robots.append(RobotState(event.robot, inner["speed"], inner["budget"], *_NOTHING, **told))
        record.fixes.append([PositionReport(time, *place.tolist())])
        record.measurements.admit(len(record.robots), record.ground.room(record.changes))


def _settle(record: RecordedSurvey) -> None:
    """Make place and mission those that the changes have led to."""
    changes, place = record.changes, record.place
    if changes == Changes():
        return
    scenario = record.ground.scenario(changes)
    if changes.threshold is not None:
        threshold = changes.threshold.value
        beta = interest_beta(threshold) if place.beta_follows else scenario.beta
        scenario = scenario.replace(threshold=threshold, beta=beta)
    zones = tuple(ruling.told for _, ruling in changes.zones if ruling.told is not None)
    given = place.site.threshold or changes.threshold is not None
    site = dataclasses.replace(place.site, no_go=(*place.site.no_go, *zones), threshold=given)
    starts = np.array(record.ground.starts(changes))
    record.place = dataclasses.replace(place, scenario=scenario, starts=starts, site=site)
    record.mission = dataclasses.replace(record.place, starts=np.array(scenario.starts)).mission()
