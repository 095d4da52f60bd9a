"""`LiveSurvey`: takes what robots report, in any order and as often as they like, and says where to go next."""

import copy
import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from maipp.belief.refit import HyperPrior
from maipp.errors import InputError
from maipp.foresight import ForesightName
from maipp.live import queries
from maipp.live.answers import decision_answer, late, state_of
from maipp.live.arrival import Arrival, decide_arrival, head_home
from maipp.live.belief_problem import place_of
from maipp.live.changes import Changes
from maipp.live.changing import Changed, changed, consider
from maipp.live.differences import check_same
from maipp.live.effects import Effect, effect, inside
from maipp.live.events import (
    Arrived,
    Budget,
    Change,
    Event,
    Keep,
    Measurement,
    OfRobot,
    Withdraw,
    fingerprint,
    read_event,
    write_event,
)
from maipp.live.finite_answers import whole
from maipp.live.gate import LEVEL
from maipp.live.journal import Journal
from maipp.live.measurement_answers import judged
from maipp.live.measurements import MeasurementSet
from maipp.live.refits import take_up, written
from maipp.live.request import BeliefQuery, HelloQuery, Query, read_query
from maipp.live.robot_state import GONE, RobotState
from maipp.live.setups import prepared_setup, scenario_setup
from maipp.live.world import Setup, World, draw_world, make_gate
from maipp.live.worlds import Worlds
from maipp.planners import make_planner
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey
from maipp.typing import Float


class LiveSurvey:
    """A survey under way. Give it events, one at a time; it answers with dictionaries ready for JSON (docs/live.md).

    Each event is in the journal, on the disk, before its answer is returned. An event that was answered before gets
    the same answer again and changes nothing. Opened anew on its journal, the survey goes on where it was. Not for use
    by several threads at once. Close it, or use it in a `with` block, to release the journal.
    """

    # Names of the robots that a robot deciding now can hear; None: all that are not gone.
    within_reach: frozenset[str] | None = None

    def __init__(self, world: World, setup: Setup, journal: str | os.PathLike[str] | None = None) -> None:
        """Begin the survey, or go on with the one in the journal; without a journal nothing outlives the process.

        Raises `InputError` for a journal that is damaged, in use, or of another mission.
        """
        self.setup, self._worlds, self._changes = setup, Worlds(world, setup), Changes()
        real = np.dtype(jax.dtypes.canonicalize_dtype(float))
        gate = make_gate(world.mission, world.scenario, setup.gate, setup.adapt)
        self._measurements = MeasurementSet(len(setup.robots), setup.room, real, gate)
        self._answers: dict[str, tuple[bytes, dict[str, Any]]] = {}
        self._unsound: str | None = None  # id of an event that may be in the journal and is not yet taken over
        numbers, nothing = world.mission.params, self._worlds.nothing(len(setup.robots))
        starts = np.asarray(world.mission.start, np.float64)
        speeds, budgets = (np.asarray(a, np.float64).tolist() for a in (numbers.speeds, numbers.budgets))
        self._robots = [
            RobotState(name, speed, budget, *nothing, leg=np.array([start]))
            for name, start, speed, budget in zip(setup.robots, starts.tolist(), speeds, budgets, strict=True)
        ]
        self._journal = None if journal is None else Journal(journal)
        self._keep = None if self._journal is None else self._journal.append
        try:
            self._replay()
        except BaseException:
            self.close()
            raise

    @classmethod
    def from_scenario(
        cls,
        scenario: Scenario,
        planner: str = "receding-horizon",
        options: Mapping[str, object] | None = None,
        *,
        seed: int = 0,
        robots: Sequence[str] | None = None,
        journal: str | os.PathLike[str] | None = None,
        prior: tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]] | None = None,
        prior_noise: float | None = None,
        epoch: float = 0.0,
        gate: float = LEVEL,
        adapt: HyperPrior | bool = False,
    ) -> "LiveSurvey":
        """A survey of a scenario; by default in its own units, with robots called robot1, robot2 and so on.

        `seed` draws starts where the scenario gives none, roadmaps, and the planner's randomness. `prior` are older
        samples: domain positions and standardised values, whose noise variance is `prior_noise`, or the scenario's.
        Measurements more surprising than `gate` standard deviations are kept out of the belief; with 0 none is.
        `adapt` refits the kernel under way, around the scenario's or with a prior of its own.
        Raises `InputError` for a planner, an option or a journal that cannot be used.
        """
        built = make_planner(planner, scenario, options)
        if scenario.obstacles and not built.avoids_obstacles:
            raise InputError(f"planner {planner}: it would cross the no-go zones; give one that keeps out of them")
        setup = scenario_setup(scenario, planner, options, seed, robots, epoch, gate, adapt, prior, prior_noise)
        return cls(draw_world(built, scenario, seed, prior, prior_noise), setup, journal)

    @classmethod
    def from_prepared(
        cls,
        prepared: PreparedSurvey,
        *,
        seed: int | None = None,
        journal: str | os.PathLike[str] | None = None,
        epoch: float = 0.0,
    ) -> "LiveSurvey":
        """A survey of a real place, in its own coordinates and units; `seed` replaces the mission file's.

        `epoch` is the caller's time of the start (s). Raises `InputError` as `from_scenario`.
        """
        built = prepared.make_planner()
        seed = prepared.survey.seed if seed is None else seed
        setup, scenario = prepared_setup(prepared, seed, epoch), prepared.scenario
        return cls(draw_world(built, scenario, seed, prepared.prior, prepared.prior_noise), setup, journal)

    # What a caller asks and reports.

    def handle(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request: an object with `event` or `query`.

        Raises `InputError`, and changes nothing, for a request that is not right.
        """
        if "event" in request:
            return self.report(read_event(request, self._names))
        if "query" in request:
            return self._ask(read_query(request))
        raise InputError("neither an event nor a query; give one of the keys `event` and `query`")

    def report(self, event: Event) -> dict[str, Any]:
        """The answer to an event, once it is in the journal. Raises `InputError` for one that is not right.

        What it changes is worked out before it is written down: where that fails, nothing has changed.
        """
        self._check_sound()
        digest = fingerprint(event)
        if event.id in self._answers:
            known, answer = self._answers[event.id]
            if known != digest:
                raise InputError(f"id: another event has the id {event.id[:60]!r}; give each event its own")
            return copy.deepcopy(answer)
        inner = inside(event, self.setup.units, self._nothing, self.setup.gate > 0)
        answer, state = self._answer(event, inner)
        whole(answer)
        effect = self._effect(event, inner, answer, state)
        if self._keep is not None:
            self._unsound = event.id
            try:
                record = {"event": write_event(event), "answer": answer} | ({"state": state} if state else {})
                record |= written(self._measurements.fits)
                self._keep(record)
            except BaseException:  # the journal is what it was
                self._unsound = None
                raise
        self._apply(event, digest, answer, effect)
        return copy.deepcopy(answer)  # whatever the caller does with it, the next one gets the same

    def hello(self) -> dict[str, Any]:
        """Who answers here: protocol, planner, robots and units."""
        self._check_sound()
        return queries.hello(self.world, self.setup, self._robots, len(self._answers), self._changes)

    def state(self) -> dict[str, Any]:
        """What is known of the robots, and how much has been reported."""
        self._check_sound()
        events = len(self._answers)
        return queries.state(self.setup, self._robots, events, self._measurements, self._changes)

    def belief(
        self, points: Sequence[tuple[float, float]] | None = None, foresight: ForesightName | None = None
    ) -> dict[str, Any]:
        """Mean and standard deviation at the caller's points; without points, on the evaluation grid.

        With a `foresight` what it expects of the true field as well, `foreseen_mean` and `foreseen_std`. Points of the
        grid that lie in no-go zones have `inside` false. Raises `InputError` where one is not finite.
        """
        self._check_sound()
        return whole(queries.belief(self.world, self.setup, self._measurements, points, foresight))

    def warm_up(self) -> None:
        """Compile all that answers need, so that none has to wait for it."""
        robot = self._robots[0]
        self._arrival(robot, robot.position, 0.0, 0.0).decided()
        self.belief()

    def changed(self) -> str:
        """After an error of ours, in words: what has become of the event."""
        if self._unsound is None:
            return "nothing was changed"
        return "the event is in the journal, start again on it" if self._keep is not None else "start anew"

    @property
    def world(self) -> World:
        """What decisions are made in now; drawn anew when it is first needed after a change."""
        return self._worlds.of(self._changes)

    @property
    def _nothing(self) -> tuple[Any, Any]:
        return self._worlds.nothing(len(self._robots))

    @property
    def _names(self) -> list[str]:
        return [robot.name for robot in self._robots]

    @property
    def cut(self) -> int:
        """Bytes of a torn last line that were removed when the journal was opened."""
        return 0 if self._journal is None else self._journal.cut

    def close(self) -> None:
        """Release the journal."""
        if self._journal is not None:
            self._journal.close()

    def __enter__(self) -> "LiveSurvey":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # How events become answers, and what they change.

    def _ask(self, query: Query) -> dict[str, Any]:
        name = {} if query.id is None else {"id": query.id}
        if isinstance(query, BeliefQuery):
            answer = self.belief(query.points, query.foresight)
        else:
            answer = self.hello() if isinstance(query, HelloQuery) else self.state()
        return {"answer": answer.pop("answer")} | name | answer

    def _robot(self, event: OfRobot) -> RobotState:
        return self._robots[self._names.index(event.robot)]

    def _arrival(self, robot: RobotState, position: Float[np.ndarray, "2"], time: float, odometer: float) -> Arrival:
        """A robot at a position; it stands for the one of its name."""
        team = [robot if each.name == robot.name else each for each in self._robots]
        world = self.world.known(self._measurements.kernel, self.setup.beta_follows)
        return Arrival(world, team, self._measurements.slots(), robot, position, time, odometer, self.within_reach)

    def _answer(self, event: Event, inner: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
        """The answer to an event, and what it changes besides: for an arrival, and a budget that sends a robot home."""
        if isinstance(event, Budget):
            return self._granted(event, inner)
        if isinstance(event, Change):
            return consider(event, inner, self._changes, self._robots, self._worlds)
        if isinstance(event, Measurement | Withdraw | Keep):
            return judged(event, self._of_robot(event, inner, {}, None), self._measurements), None
        if not isinstance(event, Arrived):
            return {"answer": "noted", "id": event.id}, None
        robot, head = self._robot(event), {"id": event.id, "robot": event.robot}
        time, position, travelled = inner["time"], inner["position"], inner["travelled"]
        if time < robot.latest and (robot.answer is not None or robot.status == GONE):
            return late(robot, head, self.setup.units), {"late": travelled}
        odometer = robot.travelled(position, travelled, time)
        made = decide_arrival(self._arrival(robot, position, time, odometer), self._nothing)
        return decision_answer(made, head, robot, odometer, self.setup.units), state_of(made, odometer)

    def _granted(self, event: Budget, inner: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
        """The answer to a budget: noted, or the way home of a robot whose leg has become too long."""
        robot = self._robot(event).copy()
        robot.grant(inner["budget"], inner["time"], event.id)
        time = max(inner["time"], robot.time)
        position, odometer = robot.where(time), robot.odometer + robot.covered(time)
        arrival = self._arrival(robot, position, time, odometer)
        made = head_home(arrival, self._nothing)
        if made is None:
            return {"answer": "noted", "id": event.id}, None
        state = {"odometer": odometer, "planned": made.planned, "leg": made.leg.tolist()}
        head = {"id": event.id, "robot": event.robot}
        return decision_answer(made, head, robot, odometer, self.setup.units), state

    def _effect(
        self, event: Event, inner: dict[str, Any], answer: dict[str, Any], state: dict[str, Any] | None
    ) -> Effect | Changed:
        if isinstance(event, Change):
            return changed(event, inner, state, self._changes, self._robots, self._worlds)
        return self._of_robot(event, inner, answer, state)

    def _of_robot(
        self, event: OfRobot, inner: dict[str, Any], answer: dict[str, Any], state: dict[str, Any] | None
    ) -> Effect:
        number = self._names.index(event.robot)
        return effect(event, inner, (number, self._robots[number]), answer, state, self._nothing)

    def _apply(self, event: Event, digest: bytes, answer: dict[str, Any], effect: Effect | Changed) -> None:
        """Take over an effect. Once begun, nothing is answered until it has been done in full."""
        self._unsound = event.id
        if isinstance(effect, Changed):
            self._changes, self._robots = effect.changes, effect.robots
            self._measurements.admit(len(self._robots), self._worlds.room(self._changes))
        else:
            if effect.sample is not None:
                self._measurements.add(effect.sample, event.id)
            if effect.decision is not None and isinstance(event, Withdraw | Keep):
                self._measurements.decide(event.measurement, effect.decision)
            self._robots[self._names.index(effect.robot.name)] = effect.robot
        self._answers[event.id] = digest, answer
        self._unsound = None

    def _check_sound(self) -> None:
        """Raise `InputError` where an event is in the journal and not in what is known here."""
        if self._unsound is not None:
            way = "start this survey again on its journal" if self._keep is not None else "start this survey anew"
            raise InputError(f"event {self._unsound[:60]!r} was accepted, and could not be taken over in full; {way}")

    # The journal.

    def _replay(self) -> None:
        """Take up what the journal holds, or begin it."""
        if self._journal is None:
            return
        header = queries.header(self._worlds.base, self.setup)
        if not self._journal.records:
            self._journal.append(header | {"place": place_of(self.world, self.setup).to_dict()})
            return
        check_same(self._journal.records[0], header, str(self._journal.path))
        for record in self._journal.records[1:]:
            take_up(self._measurements.fits, record.get("kernels", {}))
            event = read_event(record["event"], self._names)
            inner = inside(event, self.setup.units, self._nothing, self.setup.gate > 0)
            effect = self._effect(event, inner, record["answer"], record.get("state"))
            self._apply(event, fingerprint(event), record["answer"], effect)
        self._journal.records.clear()
