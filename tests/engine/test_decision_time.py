"""Timing steps missions from the host: it must step the very same missions."""

from functools import partial

import jax
import numpy as np

from maipp.engine import draw_missions, run_missions
from maipp.engine.decision_time import compiled_anew, decision_seconds, decision_time
from maipp.planners import make_planner
from maipp.scenario import Scenario
from tests.tools.bench import time_planner

SCENARIO = Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)


def test_one_time_for_each_decision_that_the_simulator_takes():
    planner = make_planner("random", SCENARIO)
    missions = draw_missions(SCENARIO, seed=1, instances=3)
    key = jax.random.key(2)
    events = np.asarray(run_missions(planner, missions, key).events)
    first, every = decision_seconds(planner, missions, key, least=10**6)
    assert every.shape == (events.sum(),) and first > 0
    assert decision_seconds(planner, missions, key, least=1)[1].shape == (events[0],)


def test_the_p95_is_not_below_the_median():
    planner = make_planner("random", SCENARIO)
    time = decision_time(planner, draw_missions(SCENARIO, seed=1, instances=1), jax.random.key(2))
    assert 0 < time.median <= time.p95 and time.decisions > 0


def test_a_planner_is_timed_alone_and_in_a_batch():
    timing = time_planner("random", SCENARIO, missions=3, repeat=1)
    assert timing.planner == "random" and all(value > 0 for value in timing[1:])


def test_what_was_compiled_before_does_not_shorten_a_compilation():
    traced = []

    @partial(jax.jit, static_argnums=0)
    def half(static, array, number):
        traced.append(static)
        return array + number

    before = partial(half, "static", np.ones(2))
    for times in (1, 2):
        program, after = compiled_anew(before, np.float32(times))
        assert len(traced) == times and program.memory_analysis() is not None
        np.testing.assert_array_equal(after(np.float32(times)), np.full(2, 1.0 + times))
