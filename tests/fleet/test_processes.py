"""Robots as processes over links that are cut: killed, started again, and home (tests/fleet/kills.py)."""

import pytest

from tests.fleet import kills


@pytest.mark.slow
def test_robots_that_are_killed_come_home_and_nothing_is_lost(tmp_path):
    records, killed = kills.fly(tmp_path, robots=3, kills=3, seed=0, budget=1.0, cuts=True)
    assert killed == 3
    count = kills.check(tmp_path, records, ["robot1", "robot2", "robot3"], budget=1.0)
    assert count >= 3 * 3  # of the five that each budget allows, those near the start fall out on the way home
    assert len(kills.logs(tmp_path / "robot1")) == 6  # each was started twice
