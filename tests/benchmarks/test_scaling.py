"""Scaling: exponents of known laws, sizes, and one small decision that is really timed."""

import dataclasses

import pytest

from maipp.benchmarks.scaling import AXES, BASE, LARGEST, Cost, Size, growth, scaling, sizes

TINY = {"agents": 2, "measurements": 4, "grid": 5, "nodes": 12}


def cost(planner, axis, size, milliseconds, megabytes):
    where = dataclasses.asdict(size)
    times = {"decision_ms": milliseconds, "p95_ms": milliseconds, "decisions": 10, "compile_s": 1.0}
    return Cost(planner, axis, **where, **times, memory_mb=megabytes, state_mb=1.0)


def test_the_exponents_are_those_of_power_laws():
    points = [size for axis, size in sizes(AXES, BASE) if axis == "grid"]
    costs = [cost("a", "grid", s, 0.3 * s.grid**2, 5 * s.grid) for s in points]
    costs += [cost("b", "grid", s, 7.0, s.grid**0.5) for s in reversed(points)]
    costs.append(cost("a", "largest", Size(**LARGEST), 200.0, 50.0))
    found = {line.planner: line for line in growth(costs)}
    assert set(found) == {"a", "b"} and {line.axis for line in found.values()} == {"grid"}
    assert found["a"][2:] == pytest.approx((2, 2, 1)) and found["b"][2:] == pytest.approx((0, 0, 0.5))


def test_every_agent_measures_as_often():
    found = list(sizes(AXES, BASE))
    assert len(found) == sum(map(len, AXES.values()))
    for axis, size in found:
        assert size.measurements % size.agents == 0
        wanted = AXES[axis] if axis == "measurements" else (BASE["measurements"],)
        assert min(abs(size.measurements - value) for value in wanted) <= size.agents / 2


def test_decisions_are_timed_and_points_that_are_done_are_not_timed_again():
    reported = []
    planners, axes = ("shared-greedy", "lawnmower"), {"nodes": (12,), "grid": (5,)}
    first = scaling(planners, axes=axes, base=TINY, largest=None, least=3, report=reported.append)
    # A planner that has no roadmap does not depend on its nodes.
    assert [(c.planner, c.axis) for c in first] == [
        ("shared-greedy", "nodes"),
        ("shared-greedy", "grid"),
        ("lawnmower", "grid"),
    ]
    assert reported == first
    for one in first:
        assert one.size == Size(**TINY) and one.decisions == 3 and one.decision_ms <= one.p95_ms
        assert min(one.compile_s, one.memory_mb, one.state_mb) > 0
    again = scaling(planners, axes=axes, base=TINY, largest=None, least=3, done=tuple(first), report=reported.append)
    assert again == first and len(reported) == 3


def test_a_larger_belief_takes_more_memory():
    small, large = (
        scaling(("shared-greedy",), axes={}, largest=TINY | {"measurements": 200}, least=1, capacity=capacity)[0]
        for capacity in (20, 300)
    )
    assert small.axis == "largest" and small.measurements == 200
    assert large.memory_mb != small.memory_mb
