"""The figures: what is drawn is what was sampled and surveyed, and the page shows all of it."""

import csv
import gzip
import io

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.bench import figure_files
from maipp.bench.drawings import draw_curves, draw_intents, draw_stability
from maipp.bench.figure_files import FigurePlan, trace_curve, write_figures
from maipp.bench.intents import KINDS, Stability, sampled_paths
from maipp.bench.tables import Row
from maipp.engine import draw_missions, run_missions
from maipp.engine.score import score_missions
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.scenario import Scenario
from maipp.team import destination_intent, trajectory_intent

SCENARIO = Scenario(agents=2, budget=1.0, grid=8, nodes=12, neighbours=4)
RANDOM = Row("random", "random")


@pytest.fixture(scope="module")
def sampled():
    return sampled_paths(SCENARIO, paths=3, steps=2, decision=2, seed=4)


@pytest.fixture(scope="module")
def curve():
    return trace_curve(RANDOM, SCENARIO, instances=3, seed=4)


def made_up(kind: str, length: int) -> Stability:
    values = np.linspace(1.0, 2.0, 3)[:, None] * length
    return Stability(kind, length, KINDS[kind][length], values, 1.0, values)


def test_both_intents_are_of_the_same_paths(sampled):
    assert sampled.paths.shape == (3, 2, 2) and sampled.taken.any()
    paths, taken = jnp.asarray(sampled.paths), jnp.asarray(sampled.taken)
    for found, fit in ((sampled.destination, destination_intent), (sampled.trajectory, trajectory_intent)):
        np.testing.assert_allclose(np.concatenate(found), np.concatenate(fit(paths, taken)), rtol=1e-5)
    for node in sampled.paths[sampled.taken]:
        assert (sampled.nodes == node).all(axis=1).any()


def test_a_mission_that_has_ended_has_no_paths():
    with pytest.raises(InputError, match="decision 60: the mission ends before"):
        sampled_paths(SCENARIO, paths=3, steps=2, decision=60, seed=4)


def test_a_curve_ends_where_the_metrics_do(curve):
    planner = make_planner("random", SCENARIO)
    missions = draw_missions(SCENARIO, seed=4, instances=3)
    states = run_missions(planner, missions, jax.random.key(4))
    traces = curve.pivot(index="instance", columns="distance", values="trace")
    np.testing.assert_allclose(traces.iloc[:, -1], score_missions(missions, states).trace, rtol=1e-4)
    np.testing.assert_allclose(traces.columns, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    np.testing.assert_allclose(traces.iloc[:, 0], SCENARIO.grid_points)


def test_pictures_show_every_number(sampled, curve):
    (axes,) = draw_curves(curve, "title").axes
    means = curve.groupby("distance")["trace"].mean()
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_ydata()), means, rtol=1e-6)
    found = [made_up(kind, length) for kind, lengths in KINDS.items() for length in lengths]
    for axes in draw_stability(found, "title").axes:
        drawn = {float(y) for line in axes.lines for y in np.asarray(line.get_ydata(), float)}
        assert {one.trace.mean() for one in found} <= drawn
    for axes in draw_intents(sampled, SCENARIO.extent).axes:
        drawn = np.concatenate([np.asarray(line.get_xydata()) for line in axes.lines])
        assert all((np.abs(drawn - node) < 1e-6).all(axis=1).any() for node in sampled.paths[sampled.taken])


def test_the_same_seed_writes_the_same_files(tmp_path, monkeypatch, sampled):
    monkeypatch.setattr(figure_files, "measure", lambda kind, length, scenario, **_: made_up(kind, length))
    monkeypatch.setattr(figure_files, "sampled_paths", lambda scenario, **_: sampled)
    monkeypatch.setattr(figure_files, "_SURVEYED", "random")
    plan, told = FigurePlan(SCENARIO, instances=3, seed=4, rows=(RANDOM,)), []
    paths = [write_figures(plan, tmp_path / name / "run", told.append) for name in ("a", "b")]
    for first, second in zip(*paths, strict=True):
        if first.suffix != ".md":
            assert first.read_bytes() == second.read_bytes()
    pages = [
        [line for line in path[-1].read_text(encoding="utf-8").splitlines() if not line.startswith("*Wall time")]
        for path in paths
    ]
    assert pages[0] == pages[1]
    page = "\n".join(pages[0])
    assert all(f"({path.name})" in page for path in paths[0][:-1])
    assert "maipp benchmark figures --out run --instances 3 --seed 4 --budget 1 --planners random" in page
    assert page.count("- TI: ") == 3 and "| `sga-rrt-0.9` |" in page
    rows = list(csv.DictReader(io.StringIO(gzip.decompress((tmp_path / "a/run/curves.csv.gz").read_bytes()).decode())))
    assert len(rows) == 3 * 6 and rows[0]["trace"] == "64.0"
    assert rows[1]["trace"] == f"{np.float32(rows[1]['trace'])}"  # every digit of the float32
    assert len(told) == 2 * (2 + 1 + 9)
