"""A fleet in one process, on a clock that jumps from one event to the next: exact, and as fast as its decisions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from maipp.fleet.clock import VirtualClock
from maipp.fleet.hub import Hub
from maipp.fleet.robot import Robot
from maipp.fleet.simulated import Simulated
from maipp.scenario import DISTANCE_TOLERANCE


@dataclass
class VirtualFleet:
    """Robots with simulated vehicles. Events closer than rounding are one moment, as in the engine.

    In it all measurements are taken before anybody decides, and who arrives decides in the order of `robots`.
    """

    robots: Sequence[Robot]
    clock: VirtualClock
    hub: Hub
    beat: float | None = None  # seconds of the survey from one exchange of all to the next; None: only at decisions

    def run(self, observe: Callable[[Robot], object] | None = None, until: float = float("inf")) -> None:
        """Until nobody has anything left to do, or that time; `observe` is called after each decision."""
        next_beat = self.clock.time
        while (time := self._next()) is not None and time <= until:
            if self.beat is not None and next_beat <= time:
                time, next_beat = next_beat, next_beat + self.beat
            self.clock.time = self.hub.time = max(self.clock.time, time)
            if self.beat is not None:
                for robot in self.robots:
                    robot.member.listen()
                    robot.member.keep_up()
            for robot in self.robots:
                robot.measure()
            due = next((robot for robot in self.robots if robot.asks), None)
            if due is not None:
                self.clock.time = self.hub.time = max(self.clock.time, due.asks_at)
                due.decide()
                if observe is not None:
                    observe(due)

    def _next(self) -> float | None:
        if any(robot.asks for robot in self.robots):
            return self.clock.time
        vehicles = [robot.vehicle for robot in self.robots if isinstance(robot.vehicle, Simulated)]
        return min((time for time in (vehicle.next_time() for vehicle in vehicles) if time is not None), default=None)


def moment(speed: float) -> float:
    """The scenario's time within which events of a team of this fastest speed are one moment."""
    return DISTANCE_TOLERANCE / speed
