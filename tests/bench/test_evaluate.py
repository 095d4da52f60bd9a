"""The evaluation: what is drawn, what is averaged, what is written."""

import dataclasses
import json
import os

import equinox as eqx
import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from maipp.bench import evaluate as module
from maipp.bench.evaluate import Evaluation, evaluate, message_bytes, summarise
from maipp.bench.evaluations import save_evaluations, to_json
from maipp.engine import draw_missions, run_missions
from maipp.engine.score import pooled_belief, score_missions
from maipp.errors import InputError
from maipp.foresight import make_foresight
from maipp.planners import make_planner
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    return evaluate(SCENARIO, "greedy", instances=2, trials=3, seed=5, timing=False)


def test_values_are_those_of_the_missions_it_says(evaluation):
    planner = make_planner("greedy", SCENARIO)
    missions = draw_missions(SCENARIO, seed=5, instances=2, trials=3)
    # Greedy draws nothing, so any key gives its results.
    metrics = score_missions(missions, run_missions(planner, missions, jax.random.key(99)))
    for metric, values in evaluation.values.items():
        np.testing.assert_allclose(values, np.asarray(getattr(metrics, metric)).reshape(2, 3), rtol=1e-5, atol=1e-6)


def test_the_same_call_gives_the_same_numbers_and_another_seed_others():
    first, again, other = (
        evaluate(SCENARIO, "random", instances=2, trials=3, seed=seed, timing=False).values["trace"]
        for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert len(np.unique(first)) == first.size  # every trial differs


def test_another_budget_meets_the_same_worlds(monkeypatch):
    drawn = []
    monkeypatch.setattr(
        module, "run_missions", lambda *inputs, **named: drawn.append(inputs[1]) or run_missions(*inputs, **named)
    )
    for budget in (0.6, (0.4, 0.6)):
        evaluate(SCENARIO.replace(budget=budget), "greedy", instances=2, trials=3, seed=5, timing=False)
    np.testing.assert_array_equal(drawn[0].truth, drawn[1].truth)
    np.testing.assert_array_equal(drawn[0].roadmap.nodes, drawn[1].roadmap.nodes)
    np.testing.assert_allclose(drawn[1].params.budgets, [[0.4, 0.6]] * 6)


def test_missions_kept_from_another_planner_have_the_encodings_that_this_one_reads(monkeypatch):
    drawn = []

    def ended(planner, missions, key, *, first=0):
        """How the missions end is not asked here: as those of another planner do."""
        drawn.append(missions.roadmap.encoding)
        return run_missions(make_planner("greedy", SCENARIO), missions, key, first=first)

    monkeypatch.setattr(module, "run_missions", ended)
    for _ in range(2):
        evaluate(SCENARIO, "greedy", instances=2, trials=1, seed=5, timing=False)
        evaluate(SCENARIO, "sga-catnipp", {"weights": "untrained"}, instances=2, trials=1, seed=5, timing=False)
    assert [None if encoding is None else encoding.shape for encoding in drawn] == [None, (2, 2, 12, 32)] * 2


def test_parts_cover_every_mission_once(monkeypatch, evaluation):
    monkeypatch.setattr(module, "_BLOCKS_PER_PART", 1)
    monkeypatch.setattr(module, "missions_devices", lambda: [None])
    monkeypatch.setattr(module, "lanes_at_most", lambda planner: 3)  # six missions: two parts of three
    seen = []
    parts = evaluate(
        SCENARIO, "greedy", instances=2, trials=3, seed=5, timing=False, progress=lambda *at: seen.append(at)
    )
    assert seen == [(3, 6), (6, 6)]
    np.testing.assert_allclose(parts.values["trace"], evaluation.values["trace"], rtol=1e-5)
    # Five missions: a part of three, and one of two that is padded.
    odd = evaluate(SCENARIO, "greedy", instances=5, trials=1, seed=5, timing=False).values["trace"]
    assert odd.shape == (5, 1) and len(np.unique(odd)) == 5
    np.testing.assert_allclose(odd[:2, 0], evaluation.values["trace"][:, 0], rtol=1e-5)


@given(arrays.arrays(np.float64, st.tuples(st.integers(2, 5), st.integers(2, 5)), elements=st.floats(-1e3, 1e3)))
def test_summary_is_the_papers(values):
    summary = summarise(values)
    trial_means = [np.mean(column) for column in values.T]
    instance_means = [np.mean(row) for row in values]
    assert summary.mean == pytest.approx(values.mean())
    assert summary.std == pytest.approx(np.sqrt(np.var(trial_means, ddof=1)))
    assert summary.se == pytest.approx(np.sqrt(np.var(instance_means, ddof=1) / len(instance_means)))


def test_one_trial_has_no_spread_and_one_instance_no_error():
    assert summarise(np.array([[1.0], [3.0]])).std is None
    assert summarise(np.array([[1.0, 3.0]])).se is None


def test_json_holds_what_regenerates_it(evaluation, tmp_path):
    save_evaluations([evaluation], tmp_path / "out.json")
    assert os.listdir(tmp_path) == ["out.json"]
    (row,) = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["evaluations"]
    again = evaluate(
        Scenario.from_dict(row["scenario"]),
        row["planner"],
        row["options"],
        instances=row["instances"],
        trials=row["trials"],
        seed=row["seed"],
        timing=False,
    )
    np.testing.assert_array_equal(row["values"]["trace"], again.values["trace"])
    assert {"maipp", "jax", "numpy", "python"} <= row["versions"].keys()
    assert {"cpu", "cores", "backend", "precision"} <= row["machine"].keys()
    assert row["wall_s"] > 0 and row["decision_ms"] is None
    assert row["summary"]["trace"]["mean"] == pytest.approx(np.mean(row["values"]["trace"]))


def test_a_file_that_cannot_be_written_is_told_and_leaves_nothing(evaluation, tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        save_evaluations([evaluation], tmp_path / "folder")
    assert os.listdir(tmp_path) == ["folder"]


def test_timing_is_optional():
    timed = evaluate(SCENARIO, "random", instances=2, trials=3)
    assert timed.decision_ms is not None and 0 < timed.decision_ms.median <= timed.decision_ms.p95
    assert json.loads(to_json([timed]))["evaluations"][0]["decision_ms"]["decisions"] == timed.decision_ms.decisions


def test_message_bytes_count_what_is_told():
    assert message_bytes(make_planner("random", SCENARIO)) == 0
    assert message_bytes(make_planner("shared-greedy", SCENARIO)) == 2 * np.dtype(np.float32).itemsize


def test_a_field_file_is_the_ground_truth_and_gives_the_domain_its_shape(tmp_path, monkeypatch):
    np.save(tmp_path / "ramp.npy", np.tile(np.linspace(0.0, 10.0, 21), (11, 1)))  # twice as wide as high
    drawn = []
    monkeypatch.setattr(
        module, "run_missions", lambda *inputs, **named: drawn.append(inputs[1]) or run_missions(*inputs, **named)
    )
    scenario = SCENARIO.replace(field=str(tmp_path / "ramp.npy"))
    result = evaluate(scenario, "greedy", instances=2, trials=1, timing=False)
    assert result.scenario == scenario.replace(extent=(1.0, 0.5))
    np.testing.assert_allclose(drawn[0].truth, drawn[0].grid[..., 0], atol=1e-6)  # it rises from 0 to 1 along x
    assert not np.array_equal(drawn[0].start[0], drawn[0].start[1])
    assert np.isfinite(result.values["rmse"]).all()


@pytest.mark.parametrize(
    ("counts", "problem"),
    [({"instances": 0}, "instances: 0"), ({"trials": -1}, "trials: -1"), ({"seed": -1}, "seed: -1")],
)
def test_bad_counts_are_refused(counts, problem):
    with pytest.raises(InputError, match=problem):
        evaluate(SCENARIO, "greedy", **counts)


def test_a_mission_that_is_not_a_number_is_refused_by_instance_and_trial(evaluation, monkeypatch):
    def broken(*inputs, **named):
        states = run_missions(*inputs, **named)
        return eqx.tree_at(lambda s: s.measurement_y, states, states.measurement_y.at[4].set(np.nan))

    monkeypatch.setattr(module, "run_missions", broken)
    with pytest.raises(InputError, match="^instance 1, trial 1: trace is nan"):
        evaluate(SCENARIO, "greedy", instances=2, trials=3, seed=5, timing=False)


def test_a_value_that_is_not_a_number_reaches_no_file(evaluation, tmp_path):
    values = {metric: rows.copy() for metric, rows in evaluation.values.items()}
    values["rmse"][1, 2] = np.inf
    with pytest.raises(InputError, match="^instance 1, trial 2: rmse is inf"):
        save_evaluations([evaluation, dataclasses.replace(evaluation, values=values)], tmp_path / "out.json")
    assert os.listdir(tmp_path) == []


def test_the_map_of_a_foresight_is_scored_beside_the_belief_s(evaluation):
    """By its law after the survey, in NumPy; the other metrics are what they are without."""
    scored = evaluate(SCENARIO, "greedy", instances=2, trials=3, seed=5, timing=False, map="fitted").values
    for metric, values in evaluation.values.items():
        np.testing.assert_array_equal(scored[metric], values)
    planner = make_planner("greedy", SCENARIO)
    missions = draw_missions(SCENARIO, seed=5, instances=2, trials=3)
    states = run_missions(planner, missions, jax.random.key(99))
    foresight = make_foresight("fitted", SCENARIO)

    @jax.jit
    def map_of(mission, state):
        belief = pooled_belief(mission, state)
        return foresight.on(mission.problem)(belief), belief.mean, belief.std

    for number in range(6):
        law, mean, std = map_of(*jax.tree.map(lambda a, i=number: a[i], (missions, states)))
        truth, (instance, trial) = np.asarray(missions.truth[number]), divmod(number, 3)
        errors = truth - np.asarray(law.mean)
        assert scored["fitted_rmse"][instance, trial] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-3)
        for share, half in ((68, 1.0), (95, 1.96)):
            # A point on the border of its interval may fall on either side of it.
            near = 1.5 / SCENARIO.grid_points
            held = np.mean(np.abs(errors) <= half * np.asarray(law.deviation))
            assert scored[f"fitted_{share}"][instance, trial] == pytest.approx(held, abs=near)
            held = np.mean(np.abs(truth - np.asarray(mean)) <= half * np.asarray(std))
            assert scored[f"belief_{share}"][instance, trial] == pytest.approx(held, abs=near)
