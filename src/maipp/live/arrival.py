"""An arrival: what the robot and its team are known to do at that moment, and what is decided from it."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.engine.decide import Departure, decide
from maipp.engine.decision import Knowledge
from maipp.engine.polyline import place_at, shortened
from maipp.live.detour import keep_out
from maipp.live.measurements import Slots
from maipp.live.messages import stacked
from maipp.live.robots import GONE, Robot
from maipp.live.world import World
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Float


@dataclass
class Arrival:
    """A robot at a position, and all that is known."""

    world: World
    robots: list[Robot]
    slots: Slots
    robot: Robot
    position: Float[np.ndarray, "2"]  # domain units
    time: float  # the scenario's time
    odometer: float  # domain units

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
            "next_measurement": self.next_measurement,
            "speed": np.array(self.robot.speed, real),
            "measurement_x": self.slots.x,
            "measurement_y": self.slots.y,
            "measurement_time": self.slots.time,
            "measured_by": self.slots.by,
            "known": self.slots.mask,
            "heard": np.array([other.status != GONE and other is not self.robot for other in self.robots]),
            "positions": positions.astype(real),
            "messages": stacked([other.message for other in self.robots]),
        }
        return Knowledge(**jax.device_put(values))

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

    def decided(self) -> Departure:
        """The engine's answer, on the host."""
        world, agent = self.world, self.robots.index(self.robot)
        key = jax.random.fold_in(jax.random.fold_in(world.key, agent), self.robot.arrivals)
        memory = jax.device_put(self.robot.memory)
        return jax.device_get(decide(world.compiled, world.mission, key, self.knowledge, memory))


class Made(NamedTuple):
    """What was decided."""

    reason: str | None  # why the robot stops; None: it goes on
    leg: Float[np.ndarray, "v 2"]  # from its position through the waypoints; its position alone where it stops
    measure: Float[np.ndarray, "n 2"]  # where it is to measure on the way
    planned: float  # odometer at the last of these, or the one planned before
    arrival: float  # expected at the end, the scenario's time
    message: Any
    memory: Any


def decide_arrival(arrival: Arrival, nothing: tuple[Any, Any]) -> Made:
    """What the robot is to do; one that stops announces `nothing`."""
    robot, here = arrival.robot, arrival.position[None]
    if robot.budget - arrival.odometer <= DISTANCE_TOLERANCE:
        return Made("budget", here, here[:0], robot.planned, arrival.time, nothing[0], robot.memory)
    outcome = arrival.decided()
    if not outcome.go:
        return Made("planner", here, here[:0], robot.planned, arrival.time, nothing[0], outcome.memory)
    scenario, roadmap = arrival.world.scenario, arrival.world.mission.roadmap
    nodes = None if roadmap is None else np.asarray(roadmap.nodes, np.float64)[arrival.robots.index(robot)]
    planned_leg = _without_repeats(np.concatenate([here, outcome.leg[1:].astype(np.float64)]))
    leg = keep_out(scenario, planned_leg, nodes)
    if leg is None:
        return Made("no-go", here, here[:0], robot.planned, arrival.time, nothing[0], outcome.memory)
    leg = shortened(leg, robot.budget - arrival.odometer)
    length, interval = float(np.hypot(*np.diff(leg, axis=0).T).sum()), scenario.measurement_interval
    places = np.arange(arrival.to_next_measurement, length + DISTANCE_TOLERANCE, interval)
    measure = np.array([place_at(leg, float(place)) for place in places]).reshape(-1, 2)
    planned = arrival.odometer + float(places[-1]) if len(places) else robot.planned
    return Made(None, leg, measure, planned, arrival.time + length / robot.speed, outcome.message, outcome.memory)


def _without_repeats(leg: Float[np.ndarray, "v 2"]) -> Float[np.ndarray, "w 2"]:
    """The leg without waypoints that are where the one before is."""
    keep = np.ones(len(leg), bool)
    keep[1:] = np.hypot(*np.diff(leg, axis=0).T) > DISTANCE_TOLERANCE
    return leg[keep]
