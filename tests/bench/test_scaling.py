"""Scaling: exponents of known laws, sizes, and one small decision that is really timed."""

import dataclasses
from functools import partial

import pytest

from maipp.bench.scaling import AXES, BASE, LARGEST, Cost, Size, growth, measure, points
from maipp.bench.scaling_report import add_missing

TINY = {"agents": 2, "measurements": 4, "grid": 5, "nodes": 12}


def cost(planner, axis, size, milliseconds, megabytes):
    where = dataclasses.asdict(size)
    times = {"decision_ms": milliseconds, "p95_ms": milliseconds, "decisions": 10, "compile_s": 1.0}
    return Cost(planner, axis, **where, **times, memory_mb=megabytes, state_mb=1.0)


def test_the_exponents_are_those_of_power_laws():
    sizes = [size for _, axis, size in points(("lawnmower",)) if axis == "grid"]
    costs = [cost("a", "grid", s, 0.3 * s.grid**2, 5 * s.grid) for s in sizes]
    costs += [cost("b", "grid", s, 7.0, s.grid**0.5) for s in reversed(sizes)]
    costs.append(cost("a", "largest", Size(**LARGEST), 200.0, 50.0))
    found = {line.planner: line for line in growth(costs)}
    assert set(found) == {"a", "b"} and {line.axis for line in found.values()} == {"grid"}
    assert found["a"][2:] == pytest.approx((2, 2, 1)) and found["b"][2:] == pytest.approx((0, 0, 0.5))


def test_every_agent_measures_as_often():
    found = list(points(("shared-greedy",)))
    assert len(found) == sum(map(len, AXES.values())) + 1 and found.pop()[1:] == ("largest", Size(**LARGEST))
    for _, axis, size in found:
        assert size.measurements % size.agents == 0
        wanted = AXES[axis] if axis == "measurements" else (BASE["measurements"],)
        assert min(abs(size.measurements - value) for value in wanted) <= size.agents / 2


MEASURE = partial(measure, length_scale=0.25, capacity=None, least=3, seed=0)


def test_decisions_are_timed_and_points_that_are_done_are_not_timed_again():
    wanted = list(points(("shared-greedy", "lawnmower"), {"nodes": (12,), "grid": (5,)}, TINY, None))
    # A planner that has no roadmap does not depend on its nodes.
    assert [point[:2] for point in wanted] == [
        ("shared-greedy", "nodes"),
        ("shared-greedy", "grid"),
        ("lawnmower", "grid"),
    ]
    costs, told = [], []
    add_missing(costs, wanted[1:], MEASURE, told.append)
    assert [cost.point for cost in costs] == wanted[1:] and told == costs
    for one in costs:
        assert one.point[2] == Size(**TINY) and one.decisions == 3 and one.decision_ms <= one.p95_ms
        assert min(one.compile_s, one.memory_mb, one.state_mb) > 0
    before = list(costs)
    add_missing(costs, wanted, MEASURE, told.append)
    assert costs[:2] == before and [cost.point for cost in costs[2:]] == wanted[:1] and told == costs


def test_a_larger_belief_takes_more_memory():
    (point,) = points(("shared-greedy",), {}, {}, TINY | {"measurements": 200})
    small, large = (measure(*point, length_scale=0.25, capacity=c, least=1, seed=0) for c in (20, 300))
    assert small.axis == "largest" and small.measurements == 200
    assert large.memory_mb != small.memory_mb
