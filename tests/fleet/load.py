"""What a fleet costs: measurements that all robots have to learn of, a late joiner, traffic, memory.

    python -m tests.fleet.load --robots 10 --measurements 1000
    python -m tests.fleet.load --traffic

In one process, on a clock that jumps: times are of the processor. `--traffic` surveys a square kilometre at 1 m/s, with
robots that say once a second that they are there, and exchange logs every five seconds.
"""

import argparse
import resource
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from maipp.fleet.hub import Hub
from maipp.fleet.logs import Logs
from maipp.fleet.member import Member, Pace
from maipp.fleet.vehicle import Reading
from maipp.live.gate import LEVEL
from maipp.live.team import TeamSurvey
from maipp.scenario import Scenario
from tests.fleet.conftest import Team
from tests.fleet.schedules import Scripted

_PACE = Pace(beat=1.0, round=5.0)


def field(points):
    """Standardised values."""
    return np.sin(9 * points[:, 0]) * np.cos(7 * points[:, 1])


def memory() -> float:
    """Of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def learn(robots: int, measurements: int) -> None:
    """All robots measure, and learn what the others have measured."""
    team = Team(Scenario(agents=robots, budget=3.0, start=(0.5, 0.5)), ("receding-horizon", {}), gate=LEVEL)
    rng, before = np.random.default_rng(0), memory()
    with tempfile.TemporaryDirectory() as name:
        crew = []
        for i in range(robots):
            vehicle = Scripted(team.clock, tuple(team.starts[i].tolist()))
            crew.append(team.robot(i, vehicle, Path(name) / str(i), pace=_PACE))
        begun = time.process_time()
        for step in range(measurements):
            for i, robot in enumerate(crew):
                team.clock.time = team.hub.time = 5 * step + 5 * i / robots
                place = rng.random(2)
                value = float(field(place[None])[0]) + 0.05 * float(rng.standard_normal())
                robot.vehicle.reports.append(Reading(team.clock.time, tuple(place.tolist()), None, value))
                robot.work()
        took = time.process_time() - begun
        for robot in crew:
            robot.member.meet()
        count = robots * measurements
        assert all(len(robot.survey._measurements._ordered) == count for robot in crew)
        print(f"{robots} robots x {measurements}: {took:.1f} s of processor, {1e3 * took / count / robots:.2f} ms each")
        print(f"memory: {(memory() - before) / robots:.1f} MB a robot, beside {before:.0f} MB of the process")
        size = sum(path.stat().st_size for path in (Path(name) / "0").glob("*.log"))
        print(f"disk: {size / 1e6:.2f} MB a robot, {size / count:.0f} bytes a measurement")
        join(team, count)
        for robot in crew:
            robot.logs.close()


def join(team: Team, count: int) -> None:
    """Somebody comes late, and asks for everything."""
    link = team.hub.link("late")
    logs = Logs(None, None, team.mission)
    team.hub.asked, begun = 0, time.process_time()
    late = Member(TeamSurvey(team.world, team.setup), logs, link, monotonic=team.clock.now)
    late.meet()
    served = time.process_time() - begun
    assert len(late.survey._measurements._ordered) == count
    begun = time.process_time()
    known = len(late.survey._measurements)
    judged = time.process_time() - begun
    print(
        f"late joiner: {count} measurements, {team.hub.asked / 1e6:.2f} MB in {served:.2f} s; judged in {judged:.2f} s"
    )
    print(f"{known} count")


class Counting(Hub):
    """Counts what robots send, by topic."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.bytes, self.messages = Counter(), Counter()

    def publish(self, hint) -> None:
        self.bytes[hint.topic] += len(hint.payload)
        self.messages[hint.topic] += 1
        super().publish(hint)


def traffic(planner: str) -> None:
    """Three robots that survey a square kilometre at 1 m/s."""
    scenario = Scenario(agents=3, budget=3.0, speed=0.001, start=(0.5, 0.5))  # domain units of a kilometre, seconds
    team = Team(scenario, (planner, {}), gate=LEVEL)
    team.hub = Counting(seed=0)
    crew = [team.robot(i, team.vehicle(i, field), pace=_PACE) for i in range(3)]
    team.fleet(crew, beat=1.0).run()
    minutes = 3 * team.clock.time / 60
    decisions = sum(crew[0].survey.robot(name).arrivals for name in team.names)
    told = ", ".join(
        f"{topic} {team.hub.bytes[topic] / minutes:,.0f} ({team.hub.messages[topic] / minutes:.1f} of "
        f"{team.hub.bytes[topic] / team.hub.messages[topic]:.0f})"
        for topic in sorted(team.hub.bytes)
    )
    print(f"{planner}: bytes per robot and minute published: {told}; answered {team.hub.asked / minutes:,.0f}")
    print(f"  {minutes / 3:.0f} minutes, {decisions} decisions, {len(crew[0].survey._measurements)} measurements")


def main() -> None:
    """Run one of both."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--measurements", type=int, default=1000)
    parser.add_argument("--traffic", action="store_true")
    flags = parser.parse_args()
    if flags.traffic:
        for planner in ("intent-paths", "receding-horizon"):
            traffic(planner)
    else:
        learn(flags.robots, flags.measurements)


if __name__ == "__main__":
    main()
