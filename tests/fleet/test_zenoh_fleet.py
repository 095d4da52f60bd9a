"""Robots over Zenoh whose links are cut: when they heal, all know the same, and nothing is lost."""

import time

import pytest

from maipp.fleet.launch import free_ports
from maipp.fleet.logs import Logs
from maipp.fleet.member import Pace
from maipp.fleet.robot import Robot
from maipp.live.team import TeamSurvey
from tests.fleet import schedules
from tests.fleet.proxy import Proxy

pytest.importorskip("zenoh")
from maipp.fleet.zenoh_link import ZenohLink  # noqa: E402

PACE = Pace(beat=0.1, round=0.4, answer=0.2, contact=1.0, silent=2.0)
PATIENCE = 30.0  # s


class Crew:
    """Robots with links, worked in turn. Use it in a `with` block."""

    def __init__(self, team, addresses, security=None):
        """`addresses` are for each robot those that it listens at, and those that it connects to."""
        self.team, self.robots, self.links, self.kept, self.told = team, [], [], set(), []
        for number, (listen, connect) in enumerate(addresses):
            name, secure = team.names[number], security and security[number]
            more = {"listen": listen, "connect": connect, "security": secure, "lease": 2.0, "tell": self.told.append}
            link = ZenohLink(name, team.mission, **more)
            self.links.append(link)
            seal = secure and secure.seal()
            logs = Logs(None, name, team.mission, seal=seal, tell=self.told.append)
            vehicle = schedules.Scripted(team.clock, tuple(team.starts[number].tolist()))
            robot = Robot(
                TeamSurvey(team.world, team.setup),
                logs,
                link,
                vehicle,
                team.clock,
                monotonic=time.monotonic,
                pace=PACE,
                tell=self.told.append,
            )
            robot.begin()
            self.robots.append(robot)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for link in self.links:
            link.close()

    def measure(self, each):
        """Let every robot measure, and go on to its next waypoint."""
        for robot in self.robots:
            for value in range(each):
                robot.vehicle.move()
                robot.vehicle.measures(0.1 * value)
                before = robot.logs.length(robot.origin)
                robot.measure()
                self.kept |= {f"{robot.origin}.{n}" for n in range(max(before, 1), robot.logs.length(robot.origin))}
                self.team.clock.time += 0.01

    def work_until(self, condition):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, self.told[-20:]
            for robot in self.robots:
                robot.work()
            time.sleep(0.005)

    def agree(self):
        """All have come to know the same."""
        self.work_until(lambda: len({str(sorted(robot.logs.heads().items())) for robot in self.robots}) == 1)
        schedules.check(self.robots, self.kept)


@pytest.fixture
def team(make_team):
    return make_team(schedules.SCENARIO, ("greedy", {}))


@pytest.mark.parametrize("cut", ["reset", "swallow"])
def test_what_is_measured_while_links_are_cut_is_not_lost(team, cut):
    pa, pb = free_ports(2)
    with Proxy(pa) as ab, Proxy(pa) as ac, Proxy(pb) as bc:
        addresses = [
            ([f"tcp/127.0.0.1:{pa}"], []),
            ([f"tcp/127.0.0.1:{pb}"], [ab.address]),
            ([], [ac.address, bc.address]),
        ]
        with Crew(team, addresses) as crew:
            crew.measure(3)
            crew.work_until(lambda: all(len(link.peers()) == 2 for link in crew.links))
            crew.agree()
            for proxy in (ab, ac, bc):
                getattr(proxy, cut)()
            crew.measure(10)
            crew.work_until(lambda: all(robot.member.silent for robot in crew.robots))
            assert len({str(robot.logs.heads()) for robot in crew.robots}) == 3
            assert any("is silent" in line for line in crew.told)
            for proxy in (ab, ac, bc):
                proxy.heal()
            crew.measure(3)
            crew.agree()
            assert all(len(robot.logs.known) == 3 for robot in crew.robots)
            assert not [line for line in crew.told if "refused" in line or "fork" in line]


def test_two_that_never_meet_learn_of_each_other_through_a_third(team):
    """A listens, C listens, B knows both; B's link to A is gone before the one to C is there."""
    pa, pc = free_ports(2)
    with Proxy(pa) as ab, Proxy(pc) as bc:
        bc.swallow()
        addresses = [([f"tcp/127.0.0.1:{pa}"], []), ([], [ab.address, bc.address]), ([f"tcp/127.0.0.1:{pc}"], [])]
        with Crew(team, addresses) as crew:
            a, b, c = crew.robots
            crew.measure(5)
            crew.work_until(lambda: len(b.logs.known) == 2 and b.logs.length(a.origin) == a.logs.length(a.origin))
            assert crew.links[2].peers() == set()
            ab.swallow()
            bc.heal()
            crew.work_until(lambda: len(c.logs.known) == 3)
            assert c.logs.known[a.origin].lines == a.logs.known[a.origin].lines
            assert crew.links[2].peers() == {b.name}
            assert not a.logs.known.keys() & {c.origin}
            ab.heal()
            crew.agree()
            assert a.name not in crew.links[2].peers() and c.name not in crew.links[0].peers()
