"""One engine: a live survey that is told what a batch survey knows decides what that one decides."""

import itertools

import jax
import numpy as np

from maipp.engine.observe import time_tolerance
from maipp.live import LiveSurvey, world
from maipp.live.messages import pack
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS, some_planners
from tests.shared.stepped import Stepped

SCENARIO = Scenario(
    agents=2, budget=(0.9, 0.8), measurement_interval=0.2, start=(0.45, 0.2), grid=6, nodes=16, neighbours=5
)
WALL = (((0.2, 0.5), (0.7, 0.5), (0.7, 0.6), (0.2, 0.6)),)
SEED = 4
SAMPLES = np.array([[0.1, 0.9], [0.8, 0.3], [0.5, 0.75]]), np.array([0.4, -0.2, 1.1])


class Crew:
    """Live surveys told what the agents of a batch survey know: one for all, or one each where ranges are limited."""

    def __init__(self, scenario, planner, prior, folder=None):
        self.make = lambda number: LiveSurvey.from_scenario(
            scenario,
            *planner,
            seed=SEED,
            prior=prior,
            journal=None if folder is None else folder / f"{number}.journal",
        )
        self.apart = scenario.limited
        self.surveys = [self.make(i) for i in range(scenario.agents if self.apart else 1)]
        self.told = [set() for _ in self.surveys]
        self.ids = map(str, itertools.count())

    def restart(self):
        for survey in self.surveys:
            survey.close()
        self.surveys = [self.make(i) for i in range(len(self.surveys))]

    def arrive(self, known, batch):
        """Tell the due agent's survey all that it knows, then that it has arrived; the robot as it is then."""
        agent, now = int(known.agent), float(known.time)
        index = agent if self.apart else 0
        survey, names = self.surveys[index], self.surveys[index].setup.robots
        times = np.asarray(known.measurement_time)
        slots = np.flatnonzero(np.asarray(known.known))
        assert (times[slots] <= now + float(time_tolerance(batch.mission.params.speeds))).all()
        for slot in slots:
            if slot in self.told[index]:
                continue
            self.told[index].add(slot)
            survey.handle(
                {
                    "event": "measurement",
                    "id": next(self.ids),
                    "robot": names[int(known.measured_by[slot])],
                    "position": np.asarray(known.measurement_x[slot]).tolist(),
                    "value": float(known.measurement_y[slot]),
                    "time": float(times[slot]),
                }
            )
        if self.apart:
            self._hear(survey, known, batch)
        survey.handle(
            {
                "event": "arrived",
                "id": next(self.ids),
                "robot": names[agent],
                "position": np.asarray(known.position).tolist(),
                "time": now,
                "travelled": float(known.odometer),
            }
        )
        return survey._robots[agent]

    def _hear(self, survey, known, batch):
        """What others say who are within range; those that are not are gone, as far as this survey can tell."""
        for other, name in enumerate(survey.setup.robots):
            event = {"id": next(self.ids), "robot": name, "time": float(known.time)}
            if known.heard[other] and batch.decided[other]:
                message = jax.tree.map(lambda a, i=other: np.asarray(a[i]), known.messages)
                position = np.asarray(known.positions[other]).tolist()
                survey.handle(event | {"event": "heard", "position": position, "packed": pack(message)})
            elif other != int(known.agent) and not known.heard[other]:
                survey.handle(event | {"event": "gone"})


def follow(scenario, planner, slots, *, prior=None, folder=None, exact):
    """Step both through a whole survey and compare every decision."""
    batch, crew = Stepped(scenario, planner, slots, SEED, prior), Crew(scenario, planner, prior, folder)
    for number in itertools.count():
        if not batch.going:
            break
        if folder is not None and number == 3:
            crew.restart()
        known = batch.known()
        robot = crew.arrive(known, batch)
        made = batch.decide(known)
        # Live legs leave out waypoints where the robot already is, and are cut at the budget in double precision.
        leg = (
            made.leg[np.append(True, (np.abs(np.diff(made.leg, axis=0)) > 1e-5).any(axis=1))]
            if made.go
            else made.leg[:1]
        )
        np.testing.assert_allclose(robot.leg, leg, atol=2e-6 if exact else 1e-4)
        if not made.go:  # a live survey does not ask the planner for a robot that has nothing left
            continue
        mine, told = (jax.tree.leaves((each.message, each.memory)) for each in (robot, made))
        for own, other in zip(mine, told, strict=True):
            if exact:
                np.testing.assert_array_equal(own, other)
            else:
                np.testing.assert_allclose(own, other, atol=1e-4, rtol=1e-3)
    assert number > 2 * scenario.agents
    return crew


@some_planners("shared-greedy", "lawnmower", "receding-horizon", "ti")
def test_in_the_same_shape_decisions_are_the_same_to_the_bit(name, tmp_path):
    """Prior samples, no-go zones, homes, and a restart half-way."""
    scenario = SCENARIO.replace(obstacles=WALL, end="start", reserve=0.05)
    slots = -(-5 * scenario.measurements_per_agent // 4)  # what a live survey has room for
    follow(scenario, (name, TINY_PLANNERS[name]), slots, prior=SAMPLES, folder=tmp_path, exact=True)


def test_foreseeing_decides_the_same(tmp_path):
    """What is foreseen, old samples among what it is foreseen from, in a domain that is not square."""
    scenario = SCENARIO.replace(obstacles=WALL, extent=(1.0, 1.2))
    slots = -(-5 * scenario.measurements_per_agent // 4)
    planner = "foresight", TINY_PLANNERS["receding-horizon"]
    follow(scenario, planner, slots, prior=SAMPLES, folder=tmp_path, exact=True)


@some_planners("shared-greedy", "di")
def test_with_a_limited_range_and_growing_room_they_are_the_same_up_to_rounding(name, monkeypatch):
    """Each robot has a survey of its own, which is told what it hears, and begins with room for one measurement.

    The factor of a belief with other slots is rounded otherwise, at 1e-6 or so; a gradient step carries that on.
    """
    monkeypatch.setattr(world, "_RESERVE", 0.2)
    scenario = SCENARIO.replace(comm_range=0.3)
    crew = follow(scenario, (name, TINY_PLANNERS[name]), None, exact=False)
    room = [len(survey._measurements.slots().y) for survey in crew.surveys]
    assert max(room) > scenario.agents  # it has grown


def test_what_no_survey_was_told_is_unknown():
    """The check of the equality: a measurement kept back changes what is decided."""
    batch, crew = Stepped(SCENARIO, ("greedy", {}), None, SEED), Crew(SCENARIO, ("greedy", {}), None)
    crew.told[0] = set(range(2 * batch.mission.shape.slots))
    legs = []
    while batch.going:
        known = batch.known()
        legs.append((crew.arrive(known, batch).leg[-1], batch.decide(known).leg[-1]))
    assert any(not np.allclose(mine, other, atol=1e-3) for mine, other in legs)
