"""The event-driven engine on surveys small enough to follow by hand."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process.kernels import Matern

from maipp.engine import Decision, Planner, draw_missions, rollout, run_missions
from maipp.engine.state import BY_PLANNER, NOT_FINITE, RECORD_FULL, SPENT, TRAVELLING, route_capacity
from maipp.scenario import Scenario

AGENTS, DECISIONS, WAYPOINTS, INTERVAL = 3, 6, 2, 0.2
SEEDS = st.integers(0, 2**32 - 1)
# The budget and the speed are the largest that any world below uses, so that all of them share one compilation.
GLOBAL = Scenario(agents=AGENTS, budget=1.0, speed=2.0, measurement_interval=INTERVAL, grid=8)
SHORT = GLOBAL.replace(comm_range=0.3)


def straight(start: Any = (0.05, 0.5), leg: Any = (0.15, 0.0), budget: Any = 1.0, speed: Any = 1.0):
    """A world in which every agent goes straight on; arguments per agent or for all."""
    start, leg = (np.broadcast_to(np.asarray(a, float), (AGENTS, 2)) for a in (start, leg))
    ends = start[:, None] + leg[:, None] * np.arange(1, DECISIONS + 1)[:, None]
    return SimpleNamespace(
        start=start,
        budgets=np.broadcast_to(np.asarray(budget, float), AGENTS),
        speeds=np.broadcast_to(np.asarray(speed, float), AGENTS),
        script=np.repeat(ends[:, :, None], WAYPOINTS, axis=2),
        halt=np.zeros((AGENTS, DECISIONS), bool),
    )


def test_a_finished_mission_does_not_change(play):
    """Agent 0 stops first; it must not hear the others once more when all is over."""
    _, states = play(GLOBAL, straight(budget=[0.3, 1.0, 1.0]))
    end = int(states.events[-1])
    assert end < len(states.events) - 1 and not states.active[end].any()
    assert states.known[end, 0].sum() < states.known[end, 1].sum()
    assert states.stopped_by[end, 0] == SPENT
    for leaf in jax.tree.leaves(states):
        for later in range(end + 1, len(states.events)):
            np.testing.assert_array_equal(leaf[later], leaf[end])


@pytest.mark.parametrize("leg", [0.15, 0.2, 0.05])
def test_agents_that_arrive_together_decide_in_their_order(play, leg):
    _, states = play(GLOBAL, straight(leg=(leg, 0.0), budget=0.85))
    deciders = np.argmax(np.diff(states.memory["step"], axis=0), axis=1)
    events = int(states.events[-1])
    assert events % AGENTS == 0
    np.testing.assert_array_equal(deciders[:events], np.tile(np.arange(AGENTS), events // AGENTS))
    # So the second knows what the first is up to, but the first not yet what the second is.
    np.testing.assert_array_equal(states.memory["messages"][3, 1, [0, 2]], [0, -1])
    np.testing.assert_array_equal(states.memory["messages"][3, 0, [1, 2]], [-1, -1])


def test_arrivals_that_rounding_parts_are_simultaneous(play):
    """Agent 0 arrives by two legs, agent 1 by one of the same length, at a float32 time just before."""
    world = straight()
    for share in np.linspace(0.11, 0.89, 40):
        world.script[0, 0], world.script[0, 1] = world.start[0] + (0.3 * share, 0), world.start[0] + (0.3, 0)
        world.script[1:, 0] = world.start[0] + (0.3, 0)
        _, states = play(GLOBAL, world)
        if states.arrival[4, 0] > states.arrival[4, 1]:
            break
    else:
        raise AssertionError("no two arrivals that differ by rounding")
    assert states.arrival[4, 0] - states.arrival[4, 1] < 1e-6
    np.testing.assert_array_equal(states.memory["step"][5:8], states.memory["step"][4] + np.tri(3, dtype=int))


@settings(max_examples=30)
@given(seed=SEEDS)
def test_a_leg_of_one_interval_ends_at_a_measurement(play, seed):
    """However the lengths round: one measurement a leg, known at its end, and a whole interval to the next."""
    rng = np.random.default_rng(seed)
    world = straight(start=rng.uniform(0.4, 0.6, (AGENTS, 2)), speed=rng.uniform(0.3, 2.0, AGENTS))
    angle = rng.uniform(0, 2 * np.pi, (AGENTS, DECISIONS))
    step = INTERVAL * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    step[:, 1::2] = -step[:, ::2]  # out and back, so as to stay inside
    ends = world.start[:, None] + np.cumsum(step, axis=1)
    world.script[:] = ends[:, :, None].astype(np.float32)
    _, states = play(GLOBAL, world)
    np.testing.assert_array_equal(states.taken[-1], 5)
    np.testing.assert_allclose(states.measurement_x[-1], ends[:, :5], atol=1e-5)
    for number in range(1, int(states.events[-1]) + 1):
        agent = int(np.argmax(states.memory["step"][number] - states.memory["step"][number - 1]))
        taken = int(states.memory["step"][number, agent]) - 1
        if taken < 5:
            assert states.memory["to_next_measurement"][number, agent] == pytest.approx(INTERVAL, abs=1e-5)
        assert states.known[number, agent, agent].sum() == min(taken, 5)


@pytest.mark.parametrize(
    ("budget", "leg", "count"),
    [(1.0, 0.2, 5), (0.6, 0.2, 3), (0.6, 0.15, 3), (0.59, 0.2, 2), (0.8, 0.14, 4), (0.2, 0.2, 1), (0.19, 0.2, 0)],
)
def test_the_measurement_at_exactly_the_budget_counts(play, budget, leg, count):
    _, states = play(GLOBAL, straight(start=(0.0, 0.5), leg=(leg, 0.0), budget=budget))
    np.testing.assert_array_equal(states.taken[-1], count)
    x = states.measurement_x[-1, 0, :count]
    np.testing.assert_allclose(x[:, 0], INTERVAL * np.arange(1, count + 1), atol=1e-6)
    np.testing.assert_allclose(states.odometer[-1], min(budget, DECISIONS * leg), atol=1e-6)
    np.testing.assert_allclose(
        states.measurement_time[-1, :, :count], [INTERVAL * np.arange(1, count + 1)] * 3, atol=1e-6
    )
    # At the end everybody knows all of its own, the one at the last moment included.
    for agent in range(AGENTS):
        assert states.known[-1, agent, agent].sum() == count


def test_waypoints_outside_the_domain_are_moved_to_its_border(play):
    world = straight(start=(0.5, 0.5))
    world.script[0, 0] = [[0.5, -3.0], [-1.0, -1.0]]
    _, states = play(GLOBAL, world)
    np.testing.assert_allclose(states.route[-1, 0, :3], [[0.5, 0.5], [0.5, 0.0], [0.0, 0.0]], atol=1e-7)


def test_a_stopped_agent_stays_and_is_still_heard(play):
    world = straight(start=[(0.1, 0.5), (0.1, 0.6), (0.1, 0.7)])
    world.halt[0, 2] = True
    _, states = play(SHORT, world)
    moments = states.time >= 0.3 - 1e-6
    assert not states.active[-1].any() and moments.sum() > 5
    last = jax.tree.map(lambda a: a[-1], states)
    np.testing.assert_allclose(last.leg[0], [[0.4, 0.5]] * 3, atol=1e-6)
    assert last.odometer[0] == pytest.approx(0.3)
    assert last.memory["step"][0] == 3
    np.testing.assert_array_equal(last.stopped_by, BY_PLANNER)
    np.testing.assert_array_equal(states.stopped_by == TRAVELLING, states.active)
    # Agent 1 passes within 0.3 once more, and sees it standing there.
    seen = states.memory["positions"][:, 1, 0][states.memory["heard"][:, 1, 0] & moments]
    assert len(seen) > 0
    np.testing.assert_allclose(seen[-1], [0.4, 0.5], atol=1e-6)


def test_a_decision_to_go_nowhere_stops(play):
    world = straight()
    world.script[1, 1] = world.script[1, 0]
    _, states = play(GLOBAL, world)
    assert states.memory["step"][-1, 1] == 2
    assert not states.active[-1].any()
    assert states.odometer[-1, 1] == pytest.approx(0.15)
    assert states.route_length[-1, 1] == 1 + WAYPOINTS
    assert states.stopped_by[-1, 1] == SPENT


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_decision_that_is_not_a_number_stops(play, bad):
    world = straight()
    world.script[1, 1, -1, 0] = bad
    _, states = play(GLOBAL, world)
    assert states.memory["step"][-1, 1] == 2
    np.testing.assert_array_equal(states.stopped_by[-1], [BY_PLANNER, NOT_FINITE, BY_PLANNER])
    assert np.isfinite(states.odometer[-1]).all() and np.isfinite(states.route[-1]).all()
    assert np.isfinite(states.measurement_x[-1]).all() and np.isfinite(states.memory["mean"]).all()


def test_a_polyline_is_travelled_vertex_by_vertex(play):
    """One decision with a corner: the measurement at 0.2 lies 0.1 beyond it."""
    world = straight(budget=0.5)
    world.script[0, 0] = [[0.15, 0.5], [0.15, 0.8]]
    _, states = play(GLOBAL, world)
    np.testing.assert_allclose(states.route[-1, 0, :3], [[0.05, 0.5], [0.15, 0.5], [0.15, 0.8]], atol=1e-7)
    np.testing.assert_allclose(states.route_time[-1, 0, :3], [0.0, 0.1, 0.4], atol=1e-6)
    np.testing.assert_allclose(states.measurement_x[-1, 0, :2, :], [[0.15, 0.6], [0.15, 0.8]], atol=1e-6)
    assert states.memory["step"][1, 0] == 1 and states.time[
        np.argmax(states.memory["step"][:, 0] == 2)
    ] == pytest.approx(0.4)


def test_a_corner_cut_by_the_budget_keeps_the_rest_at_the_cut(play):
    world = straight(budget=[0.25, 0.05, 1.0])
    world.script[:, 0] = [[0.15, 0.5], [0.15, 0.8]]
    _, states = play(GLOBAL, world)
    np.testing.assert_allclose(states.route[-1, 0, :3], [[0.05, 0.5], [0.15, 0.5], [0.15, 0.65]], atol=1e-6)
    np.testing.assert_allclose(states.route[-1, 1, :3], [[0.05, 0.5], [0.1, 0.5], [0.1, 0.5]], atol=1e-6)


def test_agents_that_never_meet_never_know_of_each_other(play):
    world = straight(start=[(0.05, 0.1), (0.05, 0.5), (0.05, 0.9)])
    _, states = play(SHORT, world)
    assert not states.memory["heard"].any()
    for i in range(AGENTS):
        for j in range(AGENTS):
            assert states.known[-1, i, j].sum() == (4 if i == j else 0)


def test_what_an_agent_took_over_it_passes_on(play):
    """Agents 0 and 2 never meet. Agent 1 hears 0 until 0 turns back, having measured once, and later meets 2."""
    world = straight(
        start=[(0.15, 0.1), (0.3, 0.1), (0.95, 0.9)],
        leg=[(0.08, 0.08), (0.1, 0.15), (0.0, -0.05)],
        speed=[1.0, 1.0, 0.3],
    )
    world.script[0, 3:] = world.script[0, 2] - np.array([0.1, 0.0]) * np.arange(1, 4)[:, None, None]
    _, states = play(SHORT, world)
    heard = states.memory["heard"]
    assert not heard[:, 0, 2].any() and not heard[:, 2, 0].any()
    assert states.taken[-1, 0] == 3
    np.testing.assert_array_equal(np.flatnonzero(states.known[-1, 2, 0]), [0])
    # It came with the first meeting of 1 and 2, not before.
    meeting = int(np.argmax(heard[:, 2, 1]))
    assert not states.known[meeting - 1, 2, 0].any() and states.known[meeting, 2, 0, 0]


@pytest.mark.parametrize("scenario", [GLOBAL, SHORT], ids=["global", "limited"])
def test_the_belief_holds_what_the_agent_knows_and_nothing_else(play, scenario):
    mission, states = play(scenario, straight(start=[(0.05, 0.1), (0.05, 0.35), (0.05, 0.8)]))
    matern, grid = Matern(scenario.length_scale, nu=1.5), np.asarray(mission.grid)
    sizes = set()
    for number in range(1, int(states.events[-1]) + 1):
        agent = int(np.argmax(states.memory["step"][number] - states.memory["step"][number - 1]))
        saw = {name: value[number, agent] for name, value in states.memory.items()}
        x, y = saw["measurement_x"][saw["known"]], saw["measurement_y"][saw["known"]]
        joint = np.asarray(matern(np.concatenate([x, grid])))
        gram, cross = joint[: len(x), : len(x)] + scenario.noise * np.eye(len(x)), joint[: len(x), len(x) :]
        weights = np.linalg.solve(gram, cross)
        np.testing.assert_allclose(saw["mean"], y @ weights, atol=1e-4)
        np.testing.assert_allclose(saw["variance"], 1.0 - np.sum(cross * weights, axis=0), atol=1e-4)
        sizes.add(len(x))
    assert len(sizes) > 3 and min(sizes) == 0


class Crawl(Planner):
    """A planner gone wrong: steps so small that the budget would last for ten thousand of them."""

    @property
    def waypoints_per_decision(self):
        return WAYPOINTS

    def decide(self, key, observation, memory):
        ahead = observation.position + jnp.array([1e-4, 0.0])
        return Decision(jnp.stack([ahead, ahead]), (), memory)


def test_a_planner_of_tiny_steps_travels_its_budget():
    """Its record needs some twenty times the usual room, and gets it."""
    scenario = GLOBAL.replace(start=(0.2, 0.2), budget=0.11, measurement_interval=0.02)
    missions = draw_missions(scenario, seed=0, instances=1, roadmaps=False)
    planner = Crawl(scenario)
    final = run_missions(planner, missions, jax.random.key(0))
    assert not final.active.any() and not final.full.any()
    np.testing.assert_allclose(final.odometer[0], 0.11, atol=2e-5)
    assert (final.route_length[0] > route_capacity(scenario, planner)).all()
    route = np.asarray(final.route[0, 0, : final.route_length[0, 0]])
    np.testing.assert_allclose(
        route[:, 0], np.minimum(0.2 + 1e-4 * ((np.arange(len(route)) + 1) // 2), 0.31), atol=2e-5
    )


def test_a_planner_that_would_never_end_is_stopped(monkeypatch):
    monkeypatch.setattr(rollout, "_MOST_ROOM", 1)
    scenario = GLOBAL.replace(start=(0.2, 0.2))
    missions = draw_missions(scenario, seed=0, instances=1, roadmaps=False)
    planner = Crawl(scenario)
    final = run_missions(planner, missions, jax.random.key(0))
    assert not final.active.any()
    capacity = route_capacity(scenario, planner)
    decisions = (capacity - 1) // WAYPOINTS
    np.testing.assert_array_equal(final.route_length[0], capacity)
    np.testing.assert_array_equal(final.stopped_by[0], RECORD_FULL)
    assert int(final.events[0]) == AGENTS * decisions
    np.testing.assert_allclose(final.odometer[0], decisions * 1e-4, rtol=1e-2)
    assert np.isfinite(final.route_time[0]).all()
