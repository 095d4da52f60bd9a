"""Of robots that arrive at the same moment one decides after another, and nobody waits for ever."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.fleet.decision_order import ASKS, DECIDES, DecisionOrder

NAMES = ("a", "b", "c")


class Robot:
    """A robot step by step: it says that it asks, hears one other after the other, and then may decide."""

    def __init__(self, name, clock, hears=NAMES):
        self.turn = DecisionOrder(name, NAMES, 1000.0, clock)
        self.others = [other for other in hears if other != name]
        self.heard, self.state, self.decided = {}, "travels", False

    def step(self, phases):
        if self.state == "travels":
            self.turn.ask()
            self.heard, self.state = {}, "asks"
        elif self.state == "asks":
            missing = [other for other in self.others if other not in self.heard]
            if missing:
                self.heard[missing[0]] = phases[missing[0]]
            elif self.turn.is_due(self.heard):
                self.state = "decides"
            else:
                self.turn.ask()
                self.heard = {}
        elif self.state == "decides":
            self.turn.end()
            self.state, self.decided = "gone", True


@given(order=st.lists(st.integers(0, 2), max_size=60), seed=st.integers(0, 100))
def test_whatever_the_order_of_steps_one_decides_at_a_time_and_all_do(order, seed):
    robots = [Robot(name, lambda: 0.0) for name in NAMES]
    rest = np.random.default_rng(seed).integers(0, 3, 3000)
    for index in (*order, *rest):
        robots[index].step({robot.turn._name: robot.turn.phase for robot in robots})
        assert sum(robot.turn.phase == DECIDES for robot in robots) <= 1
    assert all(robot.decided for robot in robots)


def test_who_hears_nobody_decides_at_once():
    turn = DecisionOrder("c", NAMES, 3.0, lambda: 0.0)
    turn.ask()
    assert turn.phase == ASKS and turn.is_due({}) and turn.phase == DECIDES
    turn.end()
    assert turn.phase == ""


@pytest.mark.parametrize("other", [DECIDES, ASKS])
def test_nobody_waits_for_ever(other):
    now = [0.0]
    turn = DecisionOrder("c", NAMES, 3.0, lambda: now[0])
    turn.ask()
    assert not turn.is_due({"a": other})
    now[0] = 2.9
    turn.ask()
    assert not turn.is_due({"a": other})
    now[0] = 3.0
    turn.ask()
    assert turn.is_due({"a": other})
    turn.end()
    turn.ask()  # the next time it waits anew
    assert not turn.is_due({"a": other})
