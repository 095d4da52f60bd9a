"""Stability of intents: what is told is found, and a claim is confirmed only beyond chance."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.bench import intents as stability
from maipp.bench.intents import KINDS, Stability, as_intent, divergences, intents_told, stability_table, verdicts
from maipp.engine import draw_missions, run_missions
from maipp.planners import make_planner
from maipp.planners.announced.announcement import Announcement
from maipp.scenario import Scenario
from maipp.team import Intent
from maipp.team.intent import symmetric_kl

SCENARIO = Scenario(agents=2, budget=0.8, grid=8, nodes=12, neighbours=4)


@pytest.fixture(scope="module")
def told():
    planner = make_planner("sga-rrt", SCENARIO, {"nodes": 12})
    missions = draw_missions(SCENARIO, seed=1, instances=3, roadmaps=False)
    key = jax.random.key(2)
    return intents_told(planner, missions, key), run_missions(planner, missions, key)


def test_the_missions_are_those_of_the_simulator(told):
    history, states = told
    np.testing.assert_allclose(history.states.measurement_x, states.measurement_x, atol=1e-5)
    np.testing.assert_array_equal(history.counts.sum(axis=1), states.events)


def test_divergences_are_of_each_agent_s_successive_intents(told):
    history, _ = told
    for mission, found in enumerate(divergences(history, 2)):
        expected = []
        for agent in range(2):
            own = np.flatnonzero((history.agent[mission] == agent) & history.counts[mission])
            intents = [Intent(*(jnp.asarray(part[mission, e]) for part in history.intent)) for e in own]
            intents = [intent for intent in intents if np.isfinite(np.asarray(intent.mean)).all()]
            expected += [float(symmetric_kl(a, b)) for a, b in zip(intents[:-1], intents[1:], strict=True)]
        np.testing.assert_allclose(found, expected, rtol=1e-4)
        assert len(found) > 0


def test_a_path_counts_by_the_measurements_announced_on_it():
    points = jnp.array([[0.1, 0.2], [0.3, 0.4], [9.0, 9.0]])
    intent = as_intent(Announcement(points, jnp.array([1.0, 2.0, jnp.inf])))
    np.testing.assert_allclose(intent.mean, [0.2, 0.3], rtol=1e-6)
    with pytest.raises(TypeError, match="neither an intent nor an announced path"):
        as_intent(())


def made_up(kind: str, length: int, kl: float, trace: float) -> Stability:
    noise = 0.01 * np.arange(12, dtype=np.float64)[:, None]
    return Stability(kind, length, KINDS[kind][length], kl + noise * (1 + length / 100), kl, trace + noise * kl)


def test_verdicts_need_differences_beyond_chance():
    confirmed = [made_up("TI", 3, 1.0, 9.0), made_up("TI", 6, 2.0, 8.0), made_up("TI", 9, 3.0, 8.5)]
    assert verdicts(confirmed).count("**confirmed**") == 3
    denied = [made_up("TI", 3, 3.0, 7.0), made_up("TI", 6, 2.0, 8.0), made_up("TI", 9, 3.0, 8.5)]
    assert verdicts(denied).count("**denied**") == 3
    assert verdicts(confirmed[:2]) == ""  # one length is missing


def test_ties_decide_nothing():
    same = made_up("DI", 3, 1.0, 9.0)
    found = [Stability("DI", j, KINDS["DI"][j], same.divergence, 1.0, same.trace) for j in (3, 6, 9)]
    assert verdicts(found).count("**not decided**") == 2


def test_the_table_has_a_line_for_each():
    lines = stability_table([made_up("TI", 3, 1.0, 9.0), made_up("SGA+RRT", 2, 1.0, 9.0)]).splitlines()
    assert len(lines) == 4
    assert lines[2].startswith("| TI, 3 nodes | `ti-3` | 1.057 ± ")
    assert lines[3].startswith("| SGA+RRT, 2 measurements | `sga-rrt-0.3` |")


def test_the_lengths_of_sga_rrt_are_its_horizons():
    for length, row in KINDS["SGA+RRT"].items():
        assert getattr(make_planner(row.planner, Scenario(), row.options), "horizon") == length  # noqa: B009
    assert stability.NODES == (3, 6, 9)
