"""What every registered planner must keep, whatever it plans: the laws of the survey and of its roadmap."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shapely.geometry import LineString, Polygon

from maipp.engine import draw_missions, run_missions
from maipp.planners import make_planner, planner_names
from maipp.scenario import Scenario
from tests.conftest import slow
from tests.shared.area_surveys import zones_in

WALL = ((0.35, 0.3), (0.65, 0.3), (0.65, 1.1), (0.35, 1.1))
SMALL: Any = {"grid": 8, "nodes": 20, "neighbours": 5}
SCENARIOS = {
    # Everything unequal, and hearing each other only now and then.
    "team": Scenario(agents=3, budget=(0.9, 0.55, 0.15), speed=(1.0, 0.6, 1.7), comm_range=0.3, **SMALL),
    "alone": Scenario(agents=1, budget=0.7, extent=(1.5, 0.8), interest_rule="variance", **SMALL),
    "walled": Scenario(agents=2, budget=0.8, obstacles=(WALL,), last_leg="stop", virtual_value="zero", **SMALL),
}
MISSIONS = 3
# Planners whose plan may be done before the budget is.
MAY_STOP_EARLY = ("lawnmower",)
# Smaller than the defaults: here it matters what a planner may do, not how well it does.
QUICK = {
    "receding-horizon": {"horizon": 2, "candidates": 16, "elites": 2, "steps": 3},
    "foresight": {"foresight": "fitted", "horizon": 2, "candidates": 16, "elites": 2, "steps": 3},
    # Sampled steps: a network that has learned nothing may find no likelier one than to and fro between two nodes.
    "sga-catnipp": {"weights": "untrained", "choose": "sample"},
    "di": {"weights": "untrained", "choose": "sample", "paths": 3, "steps": 2},
    "ti": {"weights": "untrained", "choose": "sample", "paths": 3, "steps": 2},
    "ti-star": {"weights": "untrained", "paths": 3, "steps": 2},
    "intent-paths": {"weights": "untrained", "paths": 3, "steps": 2},
    "intent-search": {
        "weights": "untrained",
        "paths": 3,
        "nodes": 2,
        "horizon": 2,
        "candidates": 16,
        "elites": 2,
        "steps": 3,
    },
}
VARIANTS = {"receding-horizon joint": ("receding-horizon", QUICK["receding-horizon"] | {"joint": True, "sweeps": 1})}
CASES = {name: (name, QUICK.get(name, {})) for name in planner_names()} | VARIANTS


@pytest.fixture(scope="module")
def survey():
    """Runs a planner on a scenario, once."""
    done = {}

    def run(name, setting):
        if (name, setting) not in done:
            scenario = SCENARIOS[setting]
            registered, options = CASES[name]
            planner = make_planner(registered, scenario, options)
            missions = draw_missions(
                scenario,
                seed=4,
                instances=MISSIONS,
                planner=planner,
            )
            states = run_missions(planner, missions, jax.random.key(2))
            done[name, setting] = planner, missions, jax.tree.map(np.asarray, states)
        return done[name, setting]

    return run


def routes(states):
    """Mission, agent, vertices and times of every route."""
    for b in range(states.route.shape[0]):
        for agent in range(states.route.shape[1]):
            count = states.route_length[b, agent]
            yield b, agent, states.route[b, agent, :count].astype(np.float64), states.route_time[b, agent, :count]


ROADMAP = [
    name for name, (registered, given) in CASES.items() if not zones_in(make_planner(registered, Scenario(), given))
]
# One survey shows that a variant runs.
PAIRS = [
    (name, setting)
    for name in CASES
    for setting in SCENARIOS
    if (setting == "team" or name not in VARIANTS)
    # Compiling is slow, and the others are `intent-paths` with other options.
    and (setting == "team" or name not in ("di", "ti", "ti-star"))
    # And `foresight` is `receding-horizon`: it is enough where all that it has besides matters.
    and (setting == "walled" or name != "foresight")
]
WALLED = [name for name, setting in PAIRS if setting == "walled"]
# Their compilations are the longest. Zones are held against `foresight` here, and in tests/engine/test_homing.py.
SLOW = (
    ("receding-horizon", "walled"),
    ("receding-horizon joint", "team"),
    ("intent-search", "walled"),
    ("intent-search", "alone"),
    ("intent-paths", "alone"),
)


def of_all(pairs):
    """These pairs as parameters."""
    return pytest.mark.parametrize(("name", "setting"), [slow(*pair) if pair in SLOW else pair for pair in pairs])


def of_walled(names):
    """These planners' names as parameters, for surveys around a wall."""
    return pytest.mark.parametrize("name", [slow(name) if (name, "walled") in SLOW else name for name in names])


@of_all(PAIRS)
def test_the_laws_of_the_survey_hold(survey, name, setting):
    scenario = SCENARIOS[setting]
    _, missions, states = survey(name, setting)
    assert not states.active.any()
    assert (states.odometer > 0).all()  # nobody stops where it stands
    assert (states.odometer <= np.asarray(missions.params.budgets) + 2e-6).all()
    for b, agent, route, times in routes(states):
        assert (route >= 0).all() and (route <= np.array(scenario.extent)).all()
        distance = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1))])
        assert distance[-1] == pytest.approx(states.odometer[b, agent], abs=5e-6)
        np.testing.assert_allclose(times * scenario.speeds[agent], distance, atol=1e-4)
        marks = scenario.measurement_interval * np.arange(1, scenario.measurements_per_agent + 1)
        count = int(np.sum(marks <= distance[-1] + 1e-5))
        assert np.isfinite(states.measurement_time[b, agent]).sum() == count
        for axis in (0, 1):
            expected = np.interp(marks[:count], distance, route[:, axis])
            np.testing.assert_allclose(states.measurement_x[b, agent, :count, axis], expected, atol=1e-5)
        field = jax.tree.map(lambda a, b=b: a[b], missions.field)
        truth = field(jnp.asarray(states.measurement_x[b, agent]))[:count]
        np.testing.assert_allclose(states.measurement_y[b, agent, :count], truth, atol=1e-5)


# On a roadmap `walled` has the rule to stop.
@of_all([p for p in PAIRS if (p[1] != "walled" or p[0] not in ROADMAP) and p[0] not in MAY_STOP_EARLY])
def test_the_budget_is_used_up(survey, name, setting):
    _, missions, states = survey(name, setting)
    np.testing.assert_allclose(states.odometer, missions.params.budgets, atol=2e-5)


def node_of(nodes, place):
    """The roadmap node at a place; None where there is none."""
    distance = np.linalg.norm(nodes - place, axis=1)
    return int(np.argmin(distance)) if distance.min() < 2e-5 else None


@of_all([pair for pair in PAIRS if pair[0] in ROADMAP])
def test_roadmap_planners_travel_along_edges(survey, name, setting):
    _, missions, states = survey(name, setting)
    for b, agent, route, _ in routes(states):
        roadmap = jax.tree.map(lambda a, b=b, agent=agent: np.asarray(a[b, agent]), missions.roadmap)
        places = [node_of(roadmap.nodes, vertex) for vertex in route]
        assert places[0] == 0
        for leg, (here, there) in enumerate(zip(places[:-1], places[1:], strict=True)):
            assert here is not None
            ends = roadmap.neighbours[here][roadmap.reachable[here]]
            if there in ends:
                continue
            # Only the last leg may end between two nodes, on an edge that was too long for the budget.
            assert leg == len(places) - 2 and SCENARIOS[setting].last_leg == "cut"
            moved = route[-1] - roadmap.nodes[here]
            edges = roadmap.nodes[ends] - roadmap.nodes[here]
            edges = edges[np.linalg.norm(edges, axis=1) > np.linalg.norm(moved)]
            beside = np.abs(edges @ [[0, 1], [-1, 0]] @ moved) / np.linalg.norm(edges, axis=1)
            assert (beside[edges @ moved > 0] < 2e-5).any()


@of_walled([name for name in WALLED if name in ROADMAP])
def test_agents_whose_rule_is_to_stop_do_so_where_no_neighbour_is_in_reach(survey, name):
    _, missions, states = survey(name, "walled")
    for b, agent, route, _ in routes(states):
        roadmap = jax.tree.map(lambda a, b=b, agent=agent: np.asarray(a[b, agent]), missions.roadmap)
        here = node_of(roadmap.nodes, route[-1])
        assert here is not None
        left = float(missions.params.budgets[b, agent]) - states.odometer[b, agent]
        assert (roadmap.distances[here][roadmap.reachable[here]] > left - 1e-5).all()


@of_walled(WALLED)
def test_planners_keep_out_of_no_go_zones(survey, name):
    _, _, states = survey(name, "walled")
    wall = Polygon(WALL).buffer(-1e-5)
    for *_, route, _ in routes(states):
        assert not LineString(route).intersects(wall)
