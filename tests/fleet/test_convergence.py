"""Whatever happens on the way, robots that hear each other again know the same (tests/fleet/schedules.py)."""

import pytest

from tests.conftest import slow
from tests.fleet import schedules


@pytest.mark.parametrize(("adapt", "count"), [(False, 30), (True, 12), slow(False, 200), slow(True, 60)])
def test_after_any_schedule_all_logs_and_beliefs_are_the_same(make_team, adapt, count):
    schedules.run(make_team, count, 25, adapt)


def test_the_check_finds_what_is_not_the_same(make_team):
    """Two robots, one of which has measured what the other has not heard of."""
    team = make_team(schedules.SCENARIO, ("greedy", {}))
    robots = [team.robot(i, schedules.Scripted(team.clock, tuple(team.starts[i].tolist()))) for i in range(2)]
    robots[0].vehicle.measures(1.0)
    robots[0].measure()
    with pytest.raises(AssertionError):
        schedules.check(robots, set())
    robots[1].member.meet()
    schedules.check(robots, {f"{robots[0].origin}.1"})
    with pytest.raises(AssertionError):
        schedules.check(robots, {"lost.1"})
