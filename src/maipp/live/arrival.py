"""An arrival: what the robot and its team are known to do at that moment, and what is decided from it."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.engine.decide import Departure, decide
from maipp.engine.decision import Knowledge
from maipp.engine.homing import full_path_home
from maipp.engine.keys import folded
from maipp.engine.polyline import place_at, shortened, without_repeats
from maipp.engine.state import AT_HOME
from maipp.live.detour import keep_out, path_out
from maipp.live.measurements import Slots
from maipp.live.messages import stacked
from maipp.live.robot_state import GONE, TRAVELLING, RobotState
from maipp.live.world import World
from maipp.roadmap import Home
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Float

# A robot on its way home is there within this part of the measurement interval: no vehicle reports the very place.
_NEAR = 0.05


@dataclass
class Arrival:
    """A robot at a position, and all that is known."""

    world: World
    robots: list[RobotState]
    slots: Slots
    robot: RobotState
    position: Float[np.ndarray, "2"]  # domain units
    time: float  # the scenario's time
    odometer: float  # domain units
    within_reach: frozenset[str] | None = None  # names of the robots that it can hear; None: all that are not gone
    drifted: "Arrival | None" = None  # from where it has to come to this position first

    @property
    def to_next_measurement(self) -> float:
        """Way until the robot is to measure again, domain units."""
        interval = self.world.scenario.measurement_interval
        return self.robot.to_next_measurement(self.time, self.odometer, interval)

    @property
    def knowledge(self) -> Knowledge:
        """What the engine takes; all arrays of fixed types, so that a decision is compiled once."""
        real = self.slots.x.dtype
        agent = self.robots.index(self.robot)
        positions = np.stack([other.where(self.time) for other in self.robots])
        positions[agent] = self.position
        values = {
            "agent": np.array(agent, np.int32),
            "time": np.array(self.time, real),
            "position": self.position.astype(real),
            "start": np.asarray(self.world.mission.start)[agent],
            "budget": np.array(self.robot.budget, real),
            "odometer": np.array(self.odometer, real),
            "homeward": np.array(self.robot.homeward),
            "next_measurement": self.next_measurement,
            "speed": np.array(self.robot.speed, real),
            "measurement_x": self.slots.x,
            "measurement_y": self.slots.y,
            "measurement_time": self.slots.time,
            "measured_by": self.slots.by,
            "known": self.slots.mask,
            "heard": np.array([self._hears(other) for other in self.robots]),
            "positions": positions.astype(real),
            "messages": stacked([other.message for other in self.robots]),
        }
        return Knowledge(**jax.device_put(values))

    def _hears(self, other: RobotState) -> bool:
        within = self.within_reach is None or other.name in self.within_reach
        return within and other.status != GONE and other is not self.robot

    @property
    def next_measurement(self) -> np.ndarray:
        """Odometer at which the robot measures next, domain units: a multiple of the interval where it keeps to it.

        Counted as the batch engine counts, in its precision, so that both decide from the same number.
        """
        real = self.slots.x.dtype.type
        place = self.odometer + self.to_next_measurement
        interval = self.world.scenario.measurement_interval
        count = round(place / interval)
        return np.array(
            real(count) * real(interval) if abs(place - count * interval) < DISTANCE_TOLERANCE else place, real
        )

    def from_free(self) -> "Arrival":
        """The same where a planner may begin: where the robot is, but in a no-go zone and outside of the domain."""
        place = path_out(self.world.scenario, self.position)
        gap = float(np.hypot(*(place - self.position)))
        if gap == 0.0:
            return self
        later = {"time": self.time + gap / self.robot.speed, "odometer": self.odometer + gap}
        return replace(self, position=place, drifted=self, **later)

    @cached_property
    def home(self) -> Home | None:
        """Where the robot is to end; None: anywhere."""
        home, agent = self.world.mission.home, self.robots.index(self.robot)
        if home is None or not np.asarray(home.ends.bound)[agent]:
            return None
        return Home(jax.tree.map(lambda array: array[agent], home.ends), home.borders)

    def decided(self) -> Departure:
        """The engine's answer, on the host."""
        world, agent = self.world, self.robots.index(self.robot)
        asked = self.drifted or self
        memory, decisions = self.robot.before(asked.position, asked.odometer)
        key = folded(world.key, agent, decisions)
        return jax.device_get(decide(world.compiled, world.mission, key, self.knowledge, jax.device_put(memory)))


class ArrivalOutcome(NamedTuple):
    """What was decided."""

    reason: str | None  # why the robot stops; None: it goes on
    homeward: bool  # whether it goes home
    leg: Float[np.ndarray, "v 2"]  # from its position through the waypoints; its position alone where it stops
    measure: Float[np.ndarray, "n 2"]  # where it is to measure on the way
    planned: float  # odometer at the last of these, or the one planned before
    arrival: float  # expected at the end, the scenario's time
    message: Any
    memory: Any


def decide_arrival(arrival: Arrival, nothing: tuple[Any, Any]) -> ArrivalOutcome:
    """What the robot is to do; one that stops announces `nothing`."""
    robot, here = arrival.robot, arrival.position[None]

    def stop(reason: str, memory: Any) -> ArrivalOutcome:
        return ArrivalOutcome(reason, False, here, here[:0], robot.planned, arrival.time, nothing[0], memory)

    spendable = robot.budget - arrival.world.scenario.reserves[arrival.robots.index(robot)]
    if arrival.home is None and spendable - arrival.odometer <= DISTANCE_TOLERANCE:
        return stop("budget", robot.memory)
    begun = arrival.from_free()
    if robot.homeward and arrival.home is not None:
        _, back = full_path_home(arrival.home, begun.position)
        if back <= _NEAR * arrival.world.scenario.measurement_interval:
            return stop("home", robot.memory)
    outcome = begun.decided()
    if not outcome.go:
        spent = spendable - arrival.odometer <= DISTANCE_TOLERANCE
        return stop("home" if outcome.stopped_by == AT_HOME else "budget" if spent else "planner", outcome.memory)
    way = keep_out(arrival.world.scenario, np.concatenate([begun.position[None], outcome.leg[1:].astype(np.float64)]))
    leg = None if way is None else without_repeats(np.concatenate([here, way]))
    if leg is None:
        return stop("no-go", outcome.memory)
    if len(leg) < 2:  # in double precision it goes nowhere
        return stop("planner", outcome.memory)
    if not outcome.homeward:
        leg = shortened(leg, spendable - arrival.odometer)
    return _made(arrival, leg, bool(outcome.homeward), outcome.message, outcome.memory)


def head_home(arrival: Arrival, nothing: tuple[Any, Any]) -> ArrivalOutcome | None:
    """What a robot under way is to do whose budget has changed: go home, where its leg has become too long for that.

    The arrival is where it should be now. None: it goes on.
    """
    robot, home = arrival.robot, arrival.home
    if home is None or robot.status != TRAVELLING or robot.homeward:
        return None
    left = robot.budget - arrival.world.scenario.reserves[arrival.robots.index(robot)] - arrival.odometer
    gone = arrival.odometer - robot.odometer
    rest = float(np.hypot(*np.diff(robot.leg, axis=0).T).sum()) - gone
    _, back = full_path_home(home, robot.leg[-1])
    if rest + back <= left + DISTANCE_TOLERANCE:
        return None
    way, _ = full_path_home(home, arrival.from_free().position)
    way = without_repeats(np.concatenate([arrival.position[None], way]))
    return _made(arrival, way, True, nothing[0], robot.memory)


def _made(arrival: Arrival, leg: Float[np.ndarray, "v 2"], homeward: bool, message: Any, memory: Any) -> ArrivalOutcome:
    """What it is to do on a leg: where to measure, and when it will be there."""
    robot, scenario = arrival.robot, arrival.world.scenario
    length, interval = float(np.hypot(*np.diff(leg, axis=0).T).sum()), scenario.measurement_interval
    places = np.arange(arrival.to_next_measurement, length + DISTANCE_TOLERANCE, interval)
    measure = np.array([place_at(leg, float(place)) for place in places]).reshape(-1, 2)
    planned = arrival.odometer + float(places[-1]) if len(places) else robot.planned
    return ArrivalOutcome(None, homeward, leg, measure, planned, arrival.time + length / robot.speed, message, memory)
