"""Fleets under any schedule of what can go wrong: lost, doubled and late messages, partitions, kills, late joiners.

    python tests/fleet/schedules.py --schedules 10000

Whatever happened, once everybody hears everybody again all logs are the same, all beliefs are the same to the bit, and
whatever a robot had measured and written down is in them.
"""

import argparse
import shutil
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test

from maipp.fleet.hub import Faults, Hub
from maipp.fleet.member import Pace
from maipp.fleet.vehicle import Fix, Reached, Reading
from maipp.live.gate import LEVEL
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=4, budget=2.0, start=(0.5, 0.5), grid=6, nodes=12, neighbours=4)
ROBOTS = st.integers(0, SCENARIO.agents - 1)
_PACE = Pace(beat=1.0, round=4.0, contact=2.0, silent=10.0)


class Scripted:
    """A vehicle that does what the schedule says."""

    def __init__(self, clock, place):
        self.clock, self.place, self.odometer, self.ahead, self.reports = clock, place, 0.0, [], []

    def where(self):
        return Fix(self.clock.now(), self.place, self.odometer)

    def go(self, waypoints, measure, *, home=False):
        self.ahead = [*waypoints]

    def hold(self):
        self.ahead = []

    def poll(self):
        reports, self.reports = self.reports, []
        return reports

    def close(self):
        pass

    def move(self):
        if self.ahead:
            place = self.ahead.pop(0)
            self.odometer += float(np.hypot(*np.subtract(place, self.place)))
            self.place = place

    def measures(self, value):
        self.reports.append(Reading(**vars(self.where()), value=value))

    def arrives(self):
        while self.ahead:
            self.move()
        self.reports.append(Reached(**vars(self.where())))


def machine_of(team_class, adapt):
    """The state machine, for robots that are made in this way."""
    team = team_class(SCENARIO, ("greedy", {}), gate=LEVEL, adapt=adapt)

    class Fleet(RuleBasedStateMachine):
        """Four robots, the last of which joins late, if at all."""

        def __init__(self):
            super().__init__()
            self.folder = Path(tempfile.mkdtemp(dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
            team.clock.time = 0.0
            self.robots, self.vehicles = {}, {}
            self.kept = set()  # measurements that were written down

        @initialize(seed=st.integers(0, 1000))
        def begin(self, seed):
            team.hub = self.hub = Hub(Faults(), seed)
            for number in range(SCENARIO.agents - 1):
                self.start(number)

        def start(self, number):
            place = tuple(team.starts[number].tolist())
            vehicle = self.vehicles.setdefault(number, Scripted(team.clock, place))
            vehicle.hold()
            robot = team.robot(number, vehicle, self.folder / str(number), pace=_PACE)
            self.robots[number] = robot
            robot.begin()

        @rule(number=ROBOTS, value=st.floats(-2, 2), spike=st.booleans())
        def measure(self, number, value, spike):
            if number not in self.robots:
                return
            self.vehicles[number].move()
            self.vehicles[number].measures(value * (50 if spike and value > 1.5 else 1))
            before = self.robots[number].logs.length(self.robots[number].origin)
            self.robots[number].measure()
            after = self.robots[number].logs.length(self.robots[number].origin)
            self.kept |= {f"{self.robots[number].origin}.{line}" for line in range(max(before, 1), after)}

        @rule(number=ROBOTS)
        def arrive(self, number):
            if number in self.robots:
                self.vehicles[number].arrives()
                self.robots[number].measure()
                self.robots[number].decide()

        @rule(number=ROBOTS)
        def work(self, number):
            if number in self.robots:
                self.robots[number].work()

        @rule(seconds=st.floats(0.1, 15.0))
        def wait(self, seconds):
            team.clock.time += seconds
            self.hub.time = team.clock.time
            for robot in self.robots.values():
                robot.member.listen()
                robot.member.keep_up()

        @rule(loss=st.floats(0, 0.5), duplicates=st.floats(0, 0.5), delay=st.floats(0, 20))
        def trouble(self, loss, duplicates, delay):
            self.hub.faults = Faults(loss, duplicates, delay)

        @rule(groups=st.lists(st.integers(0, 2), min_size=SCENARIO.agents, max_size=SCENARIO.agents))
        def part(self, groups):
            sides = [[team.names[i] for i, g in enumerate(groups) if g == side] for side in range(3)]
            self.hub.part(sides)

        @rule()
        def heal(self):
            self.hub.heal()

        @precondition(lambda self: self.robots)
        @rule(number=ROBOTS, torn=st.integers(0, 300))
        def kill(self, number, torn):
            """End a robot's process; what it carried for others may not all have reached the disk."""
            robot = self.robots.pop(number, None)
            if robot is None:
                return
            own = robot.logs.origin
            self.hub.links.pop(robot.name, None)
            robot.logs.close()
            for path in (self.folder / str(number)).glob("*.log"):
                if not path.name.startswith(f"{own.robot}."):
                    content = path.read_bytes()
                    path.write_bytes(content[: max(len(content) - torn, 0)])

        @rule(number=ROBOTS)
        def restart(self, number):
            if number not in self.robots:
                self.start(number)

        def teardown(self):
            try:
                if hasattr(self, "hub"):
                    self.settle()
            finally:
                for robot in self.robots.values():
                    robot.logs.close()
                shutil.rmtree(self.folder, ignore_errors=True)

        def settle(self):
            """Everybody is there, and hears everybody."""
            for number in range(SCENARIO.agents):
                if number not in self.robots:
                    self.start(number)
            self.hub.faults, team.clock.time = Faults(), team.clock.time + 100
            self.hub.time = team.clock.time
            self.hub.heal()
            robots = [self.robots[number] for number in range(SCENARIO.agents)]
            for robot in robots:
                robot.work()
            for robot in (*robots, *robots):
                robot.member.meet()
            check(robots, self.kept)

    return Fleet


def check(robots, kept):
    """Raise AssertionError where robots know different things."""
    first = robots[0]
    heads, slots = first.logs.heads(), first.survey._measurements.slots()
    reports = {report for report, _, _ in first.survey._measurements.everything}
    assert kept <= {*first.survey._answers}
    assert all(not robot.logs.forked for robot in robots)
    for other in robots[1:]:
        assert other.logs.heads() == heads
        for own, theirs in zip(slots, other.survey._measurements.slots(), strict=True):
            np.testing.assert_array_equal(own, theirs)
        assert other.survey._measurements.kernel == first.survey._measurements.kernel
        assert other.survey._measurements.verdicts() == first.survey._measurements.verdicts()
        assert {report for report, _, _ in other.survey._measurements.everything} == reports
        mine, others = ({origin: robot.logs.known[origin].lines for origin in heads} for robot in (first, other))
        assert mine == others


def run(team_class, schedules, steps, adapt, seed=None):
    """Run so many schedules of so many steps; raises AssertionError with the schedule that fails."""
    chosen = settings(
        max_examples=schedules,
        stateful_step_count=steps,
        deadline=None,
        derandomize=seed is None,
        database=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
    )
    run_state_machine_as_test(machine_of(team_class, adapt), settings=chosen)


def main():
    """Run schedules from the command line."""
    from tests.fleet.conftest import Team

    parser = argparse.ArgumentParser()
    parser.add_argument("--schedules", type=int, default=10_000)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--adapt", action="store_true")
    told = parser.parse_args()
    run(Team, told.schedules, told.steps, told.adapt, seed=1)
    print(f"{told.schedules} schedules of up to {told.steps} steps: all robots know the same, to the bit")


if __name__ == "__main__":
    main()
