"""What is known of each robot: where it was when, how far it has travelled, what it was told last."""

from bisect import insort
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maipp.engine.polyline import followed, place_at
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Float

# Waiting: has not reported yet. Gone: lost or called back; one that arrives after that is back.
WAITING, TRAVELLING, STOPPED, GONE = "waiting", "travelling", "stopped", "gone"

# A measurement planned this part of the interval ahead counts as taken on arrival: the robot stopped where it was to be
# taken, a little short by its odometer, and its report may still be on the way.
_SHORT = 0.05


@dataclass
class RobotState:
    """One robot, in domain units and the scenario's time; it begins at the one point of its `leg`."""

    name: str
    speed: float
    budget: float
    message: Any  # what it announced last: a pytree of host arrays
    memory: Any  # of the planner, likewise
    status: str = WAITING
    earlier: Any = None  # of the planner, before the last decision
    arrivals: int = 0  # decisions taken for it, those repeated on one spot counted once
    latest: float = 0.0  # time of its latest report of any kind
    time: float = 0.0  # of the last report of where it is
    odometer: float = 0.0  # way travelled then
    leg: Float[np.ndarray, "v 2"] = field(default_factory=lambda: np.zeros((1, 2)))  # from there on; one point: stays
    answer: dict[str, Any] | None = None  # what it was told then
    budget_from: tuple[float, str] = (-1.0, "")  # time and id of the event that set its budget
    fixes: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])  # times and odometer at its arrivals
    homeward: bool = False  # it was told to go home
    planned: float = 0.0  # odometer at the last measurement that its leg was planned with
    # Times and ids of the events that set its speed, and the speeds, in this order; the first is what it began with
    speeds: list[tuple[float, str, float]] = field(default_factory=list)
    # Time, odometer (-1: not told) at its measurements
    measured: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.speeds = self.speeds or [(-1.0, "", self.speed)]

    def copy(self) -> "RobotState":
        """One that changes without this one."""
        return replace(self, fixes=[*self.fixes], measured=[*self.measured], speeds=[*self.speeds])

    @property
    def position(self) -> Float[np.ndarray, "2"]:
        """Where it was at the last report."""
        return self.leg[0]

    @property
    def remaining(self) -> float:
        """Budget left at the last report."""
        return self.budget - self.odometer

    def where(self, time: float) -> Float[np.ndarray, "2"]:
        """Where it probably is: on the way it was told, at its usual speed."""
        return place_at(self.leg, self._run(time))

    def covered(self, time: float) -> float:
        """Way it has probably gone on its leg, domain units."""
        return min(self._run(time), float(np.hypot(*np.diff(self.leg, axis=0).T).sum()))

    def ahead(self, time: float) -> Float[np.ndarray, "w 2"]:
        """What is probably left of its leg, from where it is."""
        marks = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.leg, axis=0).T))])
        return np.concatenate([self.where(time)[None], self.leg[marks > self._run(time)]])

    def _run(self, time: float) -> float:
        """How far its speeds take it from its last report until then, domain units."""
        ends = [begin for begin, _, _ in self.speeds[1:]] + [np.inf]
        spans = (
            (max(min(end, time) - max(begin, self.time), 0.0), speed)
            for (begin, _, speed), end in zip(self.speeds, ends, strict=True)
        )
        return sum(span * speed for span, speed in spans)

    def travelled(self, position: Float[np.ndarray, "2"], told: float | None, time: float) -> float:
        """Way travelled on arrival at a position: what the odometer says, else along the leg as far as it was followed.

        Of a leg that comes by there more than once, as one out and back, time and speed tell how far.
        Never less than at the last report: an odometer that starts anew does not give a robot its budget back.
        """
        if told is not None:
            return max(told, self.odometer)
        return self.odometer + followed(self.leg, position, self.covered(time))

    def before(self, position: Float[np.ndarray, "2"], odometer: float) -> tuple[Any, int]:
        """The planner's memory to decide from there, and how many decisions came before.

        Where it has not moved since the last one, these are as they were then: it asks the same again.
        """
        still = self.arrivals > 0 and odometer == self.odometer and (position == self.leg[0]).all()
        return (self.earlier, self.arrivals - 1) if still else (self.memory, self.arrivals)

    def to_next_measurement(self, time: float, odometer: float, interval: float) -> float:
        """Way until it is to measure again, in (0, interval], counted from where it last did, or was to."""
        last = self.planned if self.planned <= odometer + _SHORT * interval else 0.0
        before = [one for one in self.measured if one[0] <= time]
        if before:
            when, told = before[-1]
            times, ways = zip(*sorted([*self.fixes, (time, odometer)]), strict=True)
            last = max(last, told if told >= 0 else float(np.interp(when, times, ways)))
        since = max(odometer - last, 0.0)
        whole = float(np.floor((since + DISTANCE_TOLERANCE) / interval))
        return min((whole + 1.0) * interval - since, interval)

    def arrive(
        self,
        time: float,
        odometer: float,
        planned: float,
        leg: Float[np.ndarray, "v 2"],
        answer: dict[str, Any],
        message: Any,
        memory: Any,
        homeward: bool = False,
    ) -> None:
        """It is at the leg's first point and was told to travel along it, one point alone: to stop.

        `planned` is the odometer at the leg's last measurement, or at the one planned before where it has none.
        """
        self.earlier, decisions = self.before(leg[0], odometer)
        self.arrivals = decisions + 1
        insort(self.fixes, (time, odometer))
        self.latest = self.time = time
        self.odometer, self.leg, self.answer = odometer, leg, answer
        self.planned, self.message, self.memory = planned, message, memory
        self.status, self.homeward = TRAVELLING if len(leg) > 1 else STOPPED, homeward

    def divert(
        self,
        time: float,
        odometer: float,
        planned: float,
        leg: Float[np.ndarray, "v 2"],
        answer: dict[str, Any],
        message: Any,
    ) -> None:
        """It was told to leave its leg where it should be now, the first point of its way home."""
        self.latest = self.time = max(time, self.latest)
        self.odometer, self.leg, self.answer = odometer, leg, answer
        self.planned, self.message, self.homeward = planned, message, True

    def note_late(self, time: float, travelled: float | None) -> None:
        """It was somewhere before its last report; only what its odometer said then is of use."""
        if travelled is not None:
            insort(self.fixes, (time, travelled))

    def leave(self, time: float, nothing: Any) -> None:
        """It is lost, unless it has reported later: it announces nothing."""
        if time >= self.latest:
            self.latest, self.message, self.status, self.answer = time, nothing, GONE, None

    def grant(self, budget: float, time: float, event: str) -> None:
        """Its whole budget is another one; of several events the latest decides."""
        if (time, event) > self.budget_from:
            self.homeward &= budget <= self.budget  # with more of it there may be more to do
            self.budget, self.budget_from = budget, (time, event)

    def pace(self, speed: float, time: float, event: str) -> None:
        """Its speed is another one from then on; of several events the latest decides what it is now."""
        insort(self.speeds, (time, event, speed))
        self.speed = self.speeds[-1][2]

    def announce(self, time: float, position: Float[np.ndarray, "2"], message: Any) -> None:
        """Another process plans for it, and this is what it told."""
        if time >= self.latest:
            self.odometer = self.travelled(position, None, time)
            self.latest = self.time = time
            self.leg, self.message, self.status = position[None], message, TRAVELLING

    def note_measurement(self, time: float, travelled: float | None) -> None:
        """Remember that it measured."""
        insort(self.measured, (time, -1.0 if travelled is None else travelled))
