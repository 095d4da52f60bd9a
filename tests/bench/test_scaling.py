"""Scaling: exponents of known laws, sizes, one small decision that is really timed, and files that hold all of it."""

import csv
import dataclasses
import json
import math
from functools import partial

import jax
import numpy as np
import pytest

from maipp.bench.belief_error import BeliefError
from maipp.bench.scaling import (
    AXES,
    BASE,
    LARGEST,
    Cost,
    ScalingResults,
    Size,
    add_missing,
    growth,
    measure,
    points,
    read_json,
    to_markdown,
    under_way,
    write_json,
    write_report,
)
from maipp.engine.observe import begin_event
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.scenario import Scenario

MID_SURVEY = Scenario(agents=3, budget=1.2, grid=6, nodes=12, neighbours=4)
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


SETTINGS = {"planner": ["shared-greedy", "intent-paths"], "seed": 0}
COSTS = [
    Cost(planner, "grid", 10, 500, grid, 200, 1.5 * grid, 2.0 * grid, 30, 4.0, 0.25 * grid, 1.0)
    for planner in SETTINGS["planner"]
    for grid in (30, 60)
]
ERRORS = [BeliefError(1500, 0.2, 0.25, 1, 3.5, 0.0123, math.nan, 0.0123, 1e-4, 2e-5)]


def test_all_files_are_written(tmp_path):
    written = write_report(ScalingResults(SETTINGS, COSTS, ERRORS), tmp_path)
    assert sorted(path.name for path in written) == sorted(path.name for path in tmp_path.iterdir())
    rows = list(csv.DictReader((tmp_path / "scaling.csv").read_text().splitlines()))
    assert [float(row["decision_ms"]) for row in rows] == [cost.decision_ms for cost in COSTS]
    content = json.loads((tmp_path / "scaling.json").read_text())
    assert [line["time"] for line in content["growth"]] == pytest.approx([1.0, 1.0])
    assert (tmp_path / "scaling.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_page_has_exponents_points_and_errors():
    page = to_markdown(ScalingResults(SETTINGS, COSTS, ERRORS))
    assert "| `intent-paths` | grid | 1.00 | 1.00 | 1.00 |" in page
    assert "| `shared-greedy` | grid | 10 | 500 | 60 | 200 | 90.0 | 120.0 | 4.0 | 15.0 | 1.0 |" in page
    assert "| 1500 | 0.2 | 0.25 | 1 | 3.5 | 1.230 % |" in page
    assert "float64" not in to_markdown(ScalingResults(SETTINGS, COSTS, []))


def test_results_read_back_for_the_same_settings_only(tmp_path):
    assert read_json(tmp_path, SETTINGS) == ScalingResults(SETTINGS, [], [])
    write_json(ScalingResults(SETTINGS, COSTS, ERRORS), tmp_path)
    found = read_json(tmp_path, SETTINGS)
    assert found.costs == COSTS and math.isnan(found.errors[0].error_se)
    assert found.errors[0]._replace(error_se=0.0) == ERRORS[0]._replace(error_se=0.0)
    assert read_json(tmp_path, SETTINGS | {"seed": 1}) == ScalingResults(SETTINGS | {"seed": 1}, [], [])


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"settings": 1}', "\x00"])
def test_another_file_of_that_name_is_refused(tmp_path, content):
    (tmp_path / "scaling.json").write_text(content)
    with pytest.raises(InputError, match=r"scaling\.json.*another --out"):
        read_json(tmp_path, SETTINGS)


@pytest.mark.parametrize("name", ["shared-greedy", "lawnmower"])
def test_everybody_is_due_and_knows_what_everybody_has_measured(name):
    planner = make_planner(name, MID_SURVEY)
    mission, state = under_way(MID_SURVEY, planner, seed=1, count=4)
    after, agent, observation = jax.jit(lambda m, s: begin_event(m, s))(mission, state)
    assert int(agent) == 0 and int(observation.known.sum()) == 3 * 4
    assert float(observation.remaining) == pytest.approx(1.2 - 4 * 0.2, abs=1e-5)
    assert float(observation.to_next_measurement) == pytest.approx(0.2, abs=1e-5)
    assert float(after.time) == pytest.approx(4 * 0.2, abs=1e-5)
    truth = np.asarray(mission.field(state.measurement_x[0, :4]))
    np.testing.assert_allclose(state.measurement_y[0, :4], truth, atol=1e-6)
