"""Numbers do not compile: scenarios of one shape share every compiled program."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from maipp.bench.evaluate import evaluate
from maipp.engine import draw_missions, run_missions
from maipp.engine import score as scores
from maipp.errors import InputError
from maipp.planners import make_planner, planner_class
from maipp.problem import params_of, problem_of, shape_of
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS, some_planners

TINY = Scenario(agents=2, grid=6, nodes=12, neighbours=4, measurement_interval=0.25)
SCENARIOS = [
    TINY.replace(budget=budget, comm_range=reach, length_scale=scale, threshold=threshold)
    for budget, reach, scale, threshold in itertools.product(
        (2.0, 3.0, 4.0, 5.0), (None, 0.6, 0.3), (0.25, 0.45), (0.3, 0.4)
    )
]
SHAPE = shape_of(SCENARIOS)


@some_planners("shared-greedy", "lawnmower", "sga-rrt", "receding-horizon", "intent-paths")
def test_budgets_ranges_length_scales_and_thresholds_compile_once(name, monkeypatch):
    options = TINY_PLANNERS[name]
    kind, traced, scored = planner_class(name), [], []
    decide, score = kind.decide, scores._score
    monkeypatch.setattr(kind, "decide", lambda *args: traced.append(1) or decide(*args))
    monkeypatch.setattr(scores, "_score", lambda *args: scored.append(1) or score(*args))
    # All of them for the cheapest; for the others the first, the last, and those that differ from them in one number.
    some = SCENARIOS if name == "shared-greedy" else [*SCENARIOS[:5], SCENARIOS[12], *SCENARIOS[-2:]]
    evaluations = [evaluate(one, name, options, instances=1, trials=1, timing=False, shape=SHAPE) for one in some[:1]]
    first = len(traced), len(scored)
    evaluations += [evaluate(one, name, options, instances=1, trials=1, timing=False, shape=SHAPE) for one in some[1:]]
    assert (len(traced), len(scored)) == first
    # The numbers are used: a longer budget is travelled, and another threshold is another area.
    assert len({round(float(each.values["distance"].mean()), 3) for each in evaluations}) > 1
    assert len({float(each.values["trace"].mean()) for each in evaluations}) > len(some) // 3


def test_the_numbers_are_the_missions_own():
    """One batch holds missions of different numbers; each is scored and run by its own."""
    short, long = (TINY.replace(budget=budget, measurement_interval=0.2) for budget in (0.4, 0.8))
    shape = shape_of([short, long])
    planner = make_planner("shared-greedy", long)
    missions = draw_missions(long, seed=1, instances=2, planner=planner, shape=shape)
    mixed = eqx.tree_at(lambda m: m.params.budgets, missions, jnp.array([[0.4, 0.4], [0.8, 0.8]]))
    states = run_missions(planner, mixed, jax.random.key(0))
    assert states.odometer[0].max() <= 0.4 + 1e-5 < states.odometer[1].max()


def test_absent_agents_take_no_part():
    scenario = TINY.replace(agents=3, budget=0.8, measurement_interval=0.2)
    planner = make_planner("shared-greedy", scenario)
    missions = draw_missions(scenario, seed=1, instances=1, planner=planner)
    pair = eqx.tree_at(lambda m: m.params.present, missions, jnp.array([[True, True, False]]))
    states = run_missions(planner, pair, jax.random.key(0))
    assert float(states.odometer[0, 2]) == 0.0 and (states.odometer[0, :2] > 0.5).all()
    assert not bool(states.known[0, :, 2].any())
    metrics = scores.score_missions(pair, states)
    whole = scores.score_missions(missions, run_missions(planner, missions, jax.random.key(0)))
    assert float(metrics.trace[0]) > float(whole.trace[0])
    assert float(metrics.unspent[0]) < 1e-4


def test_a_problem_has_the_scenario_s_names():
    scenario = TINY.replace(comm_range=0.3, budget=(2.0, 3.0), threshold=0.3)
    problem = problem_of(scenario)
    for name in ("agents", "grid", "nodes", "virtual_value", "measurements_per_agent", "measurements", "grid_points"):
        assert getattr(problem, name) == getattr(scenario, name)
    for name in ("threshold", "comm_range", "noise", "length_scale"):
        assert float(getattr(problem, name)) == pytest.approx(getattr(scenario, name))
    assert problem.budgets.tolist() == [2.0, 3.0] and problem.limited and not problem.has_zones
    assert float(params_of(TINY).comm_range) == float("inf")
    with pytest.raises(AttributeError, match="mixture_components: compiled code knows no such part"):
        problem.mixture_components  # noqa: B018


def test_what_one_program_cannot_hold_is_refused():
    with pytest.raises(InputError, match="scenario.agents: 2, 3; one shape has one"):
        shape_of([TINY.replace(budget=2.0), TINY.replace(agents=3)])
    with pytest.raises(InputError, match="slots: 2; budgets and intervals need at least 12"):
        shape_of(TINY.replace(budget=3.0), slots=2)
    zone = ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6))
    with pytest.raises(InputError, match="scenario.has_zones: False, True; one shape has one"):
        shape_of([TINY, TINY.replace(obstacles=(zone,))])
