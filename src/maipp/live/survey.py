"""`LiveSurvey`: takes what robots report, in any order and as often as they like, and says where to go next."""

import copy
import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from maipp.belief.refit import HyperPrior
from maipp.engine import Planner
from maipp.errors import InputError
from maipp.live import queries
from maipp.live.arrival import Arrival, Made, decide_arrival, turn_home
from maipp.live.effects import Effect, effect, inside
from maipp.live.events import Arrived, Budget, Event, Keep, Measurement, Withdraw, fingerprint, read_event, write_event
from maipp.live.gate import LEVEL
from maipp.live.journal import Journal
from maipp.live.judged import judged
from maipp.live.measurements import Measurements
from maipp.live.messages import describe, pack
from maipp.live.place import place_of
from maipp.live.refits import take_up, written
from maipp.live.request import PROTOCOL, Belief, Hello, Query, read_query
from maipp.live.robots import GONE, Robot
from maipp.live.site import Site
from maipp.live.units import Units
from maipp.live.whole import whole
from maipp.live.world import Setup, World, draw_world, make_gate, make_setup
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

    def __init__(self, world: World, setup: Setup, journal: str | os.PathLike[str] | None = None) -> None:
        """Begin the survey, or go on with the one in the journal; without a journal nothing outlives the process.

        Raises `InputError` for a journal that is damaged, in use, or of another mission.
        """
        self.world, self.setup = world, setup
        real = np.dtype(jax.dtypes.canonicalize_dtype(float))
        gate = make_gate(world.mission, world.scenario, setup.gate, setup.adapt)
        self._measurements = Measurements(len(setup.robots), setup.room, real, gate)
        self._answers: dict[str, tuple[bytes, dict[str, Any]]] = {}
        self._unsound: str | None = None  # id of an event that may be in the journal and is not yet taken over
        planner: Planner = world.planner
        numbers = world.mission.params
        self._nothing = jax.device_get(planner.empty_message()), jax.device_get(planner.initial_memory())
        starts = np.asarray(world.mission.start, np.float64)
        speeds, budgets = (np.asarray(a, np.float64).tolist() for a in (numbers.speeds, numbers.budgets))
        self._robots = [
            Robot(name, speed, budget, *self._nothing, leg=np.array([start]))
            for name, start, speed, budget in zip(setup.robots, starts.tolist(), speeds, budgets, strict=True)
        ]
        self._journal = None if journal is None else Journal(journal)
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
        names = tuple(robots or (f"robot{i + 1}" for i in range(scenario.agents)))
        units = Units(scenario.extent, epoch=epoch)
        around = HyperPrior(scenario.length_scale, scenario.noise, scenario.signal_variance**0.5)
        hyper = around if adapt is True else adapt or None
        setup = make_setup(scenario, planner, options, seed, names, units, gate, hyper)
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
        units = Units(prepared.scenario.extent, prepared.frame, epoch, prepared.seconds_per_time)
        seed = prepared.survey.seed if seed is None else seed
        name, options = prepared.planner, prepared.planner_options
        scenario, gate, site = prepared.scenario, prepared.survey.gate, Site.of(prepared)
        setup = make_setup(scenario, name, options, seed, prepared.names, units, gate, prepared.adapt, site)
        world = draw_world(built, scenario, seed, prepared.prior, prepared.prior_noise)
        return cls(dataclasses.replace(world, least_beta=prepared.least_beta), setup, journal)

    # What a caller asks and reports.

    def handle(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request: an object with `event` or `query`.

        Raises `InputError`, and changes nothing, for a request that is not right.
        """
        if "event" in request:
            return self.report(read_event(request, self.setup.robots))
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
        if self._journal is not None:
            self._unsound = event.id
            try:
                record = {"event": write_event(event), "answer": answer} | ({"state": state} if state else {})
                record |= written(self._measurements.fits)
                self._journal.append(record)
            except BaseException:  # the journal is what it was
                self._unsound = None
                raise
        self._apply(event, digest, answer, effect)
        return copy.deepcopy(answer)  # whatever the caller does with it, the next one gets the same

    def hello(self) -> dict[str, Any]:
        """Who answers here: protocol, planner, robots and units."""
        self._check_sound()
        return queries.hello(self.world, self.setup, self._robots, len(self._answers))

    def state(self) -> dict[str, Any]:
        """What is known of the robots, and how much has been reported."""
        self._check_sound()
        return queries.state(self.world, self.setup, self._robots, len(self._answers), self._measurements)

    def belief(self, points: Sequence[tuple[float, float]] | None = None) -> dict[str, Any]:
        """Mean and standard deviation at the caller's points; without points, on the evaluation grid.

        Points of the grid that lie in no-go zones have `inside` false. Raises `InputError` where one is not finite.
        """
        self._check_sound()
        return whole(queries.belief(self.world, self.setup, self._measurements, points))

    def warm_up(self) -> None:
        """Compile all that answers need, so that none has to wait for it."""
        robot = self._robots[0]
        self._arrival(robot, robot.position, 0.0, 0.0).decided()
        self.belief()

    def changed(self) -> str:
        """After an error of ours, in words: what has become of the event."""
        if self._unsound is None:
            return "nothing was changed"
        return "the event is in the journal, start again on it" if self._journal is not None else "start anew"

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
        if isinstance(query, Belief):
            answer = self.belief(query.points)
        else:
            answer = self.hello() if isinstance(query, Hello) else self.state()
        return {"answer": answer.pop("answer")} | name | answer

    def _robot(self, event: Event) -> Robot:
        return self._robots[self.setup.robots.index(event.robot)]

    def _arrival(self, robot: Robot, position: Float[np.ndarray, "2"], time: float, odometer: float) -> Arrival:
        """A robot at a position; it stands for the one of its name."""
        team = [robot if each.name == robot.name else each for each in self._robots]
        world = self.world.known(self._measurements.kernel)
        return Arrival(world, team, self._measurements.slots(), robot, position, time, odometer)

    def _answer(self, event: Event, inner: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
        """The answer to an event, and what it changes besides: for an arrival, and a budget that sends a robot home."""
        if isinstance(event, Budget):
            return self._granted(event, inner)
        if isinstance(event, Measurement | Withdraw | Keep):
            return judged(event, self._effect(event, inner, {}, None), self._measurements), None
        if not isinstance(event, Arrived):
            return {"answer": "noted", "id": event.id}, None
        robot, head = self._robot(event), {"id": event.id, "robot": event.robot}
        time, position, told = inner["time"], inner["position"], inner["travelled"]
        if time < robot.latest and (robot.answer is not None or robot.status == GONE):
            return self._late(robot, head), {"late": told}
        odometer = robot.travelled(position, told)
        made = decide_arrival(self._arrival(robot, position, time, odometer), self._nothing)
        state = {
            "odometer": odometer,
            "planned": made.planned,
            "leg": made.leg.tolist(),
            "homeward": made.homeward,
            "message": pack(made.message),
            "memory": pack(made.memory),
        }
        return self._told(made, head) | self._way(robot, odometer) | self._message(made), state

    def _granted(self, event: Budget, inner: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
        """The answer to a budget: noted, or the way home of a robot whose leg has become too long."""
        robot = self._robot(event).copy()
        robot.grant(inner["budget"], inner["time"], event.id)
        time = max(inner["time"], robot.time)
        position, odometer = robot.where(time), robot.odometer + robot.covered(time)
        arrival = self._arrival(robot, position, time, odometer)
        made = turn_home(arrival, self._nothing)
        if made is None:
            return {"answer": "noted", "id": event.id}, None
        state = {"odometer": odometer, "planned": made.planned, "leg": made.leg.tolist()}
        head = {"id": event.id, "robot": event.robot}
        return self._told(made, head) | self._way(robot, odometer) | self._message(made), state

    def _told(self, made: Made, head: dict[str, Any]) -> dict[str, Any]:
        units = self.setup.units
        if made.reason is not None:
            return {"answer": "stop"} | head | {"reason": made.reason}
        way = {"waypoints": units.points_out(made.leg[1:]), "measure": units.points_out(made.measure)}
        return {"answer": "home" if made.homeward else "go"} | head | way | {"arrival": units.time_out(made.arrival)}

    def _message(self, made: Made) -> dict[str, Any]:
        return {"message": None if made.reason is not None else describe(made.message, self.setup.units)}

    def _late(self, robot: Robot, head: dict[str, Any]) -> dict[str, Any]:
        """The answer to a report that is older than the robot's latest: what it was told there stands."""
        if robot.answer is None:
            stop = {"answer": "stop"} | head | {"reason": "gone"} | self._way(robot, robot.odometer)
            return stop | {"message": None, "late": True}
        again = {key: value for key, value in robot.answer.items() if key not in ("answer", "id", "robot")}
        return {"answer": robot.answer["answer"]} | head | again | {"late": True}

    def _way(self, robot: Robot, odometer: float) -> dict[str, Any]:
        units, left = self.setup.units, max(robot.budget - odometer, 0.0)
        return {"travelled": units.length_out(odometer), "remaining": units.length_out(left)}

    def _effect(
        self, event: Event, inner: dict[str, Any], answer: dict[str, Any], state: dict[str, Any] | None
    ) -> Effect:
        number = self.setup.robots.index(event.robot)
        return effect(event, inner, (number, self._robots[number]), answer, state, self._nothing)

    def _apply(self, event: Event, digest: bytes, answer: dict[str, Any], effect: Effect) -> None:
        """Take over an effect. Once begun, nothing is answered until it has been done in full."""
        self._unsound = event.id
        if effect.sample is not None:
            self._measurements.add(effect.sample, event.id)
        if effect.decision is not None and isinstance(event, Withdraw | Keep):
            self._measurements.decide(event.measurement, effect.decision)
        self._robots[self.setup.robots.index(event.robot)] = effect.robot
        self._answers[event.id] = digest, answer
        self._unsound = None

    def _check_sound(self) -> None:
        """Raise `InputError` where an event is in the journal and not in what is known here."""
        if self._unsound is not None:
            way = "start this survey again on its journal" if self._journal is not None else "start this survey anew"
            raise InputError(f"event {self._unsound[:60]!r} was accepted, and could not be taken over in full; {way}")

    # The journal.

    def _header(self) -> dict[str, Any]:
        setup = self.setup
        return {
            "journal": PROTOCOL,
            "maipp": queries.maipp_version(),
            "planner": setup.planner,
            "seed": setup.seed,
            "robots": list(setup.robots),
            "epoch": setup.units.epoch,
            "mission": setup.digest(self.world),
        }

    def _replay(self) -> None:
        """Take up what the journal holds, or begin it."""
        if self._journal is None:
            return
        header, where = self._header(), self._journal.path
        if not self._journal.records:
            self._journal.append(header | {"place": place_of(self.world, self.setup).to_dict()})
            return
        found = self._journal.records[0]
        for key, mine in header.items():
            if found.get(key) != mine:
                told = "" if key == "mission" else f" ({key} {found.get(key)!r} instead of {mine!r})"
                raise InputError(
                    f"{where}: the journal of another survey{told}; give it its own mission, or a new file"
                )
        for record in self._journal.records[1:]:
            take_up(self._measurements.fits, record.get("kernels", {}))
            event = read_event(record["event"], self.setup.robots)
            inner = inside(event, self.setup.units, self._nothing, self.setup.gate > 0)
            effect = self._effect(event, inner, record["answer"], record.get("state"))
            self._apply(event, fingerprint(event), record["answer"], effect)
        self._journal.records.clear()
