"""The meeting at the end: who is in time for it, and that teams keep it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.engine import draw_missions, run_missions
from maipp.engine.score import score_missions
from maipp.planners import make_planner
from maipp.planners.announced.meeting import Rendezvous, in_time, lateness, rendezvous, spare
from maipp.planners.intent import IntentPlanner
from maipp.roadmap import zones_of
from maipp.scenario import Scenario

MEETING = Rendezvous(jnp.array([[0.5, 0.4]]), jnp.asarray(0.1), None, jnp.ones(2), 1.1)
unit = st.floats(0, 1, width=32)


def test_a_team_meets_in_the_middle_where_radios_do_not_reach():
    meeting = rendezvous(Scenario(extent=(1.0, 0.8), comm_range=0.3))
    assert meeting is not None and meeting.places[0].tolist() == [0.5, np.float32(0.4)]
    assert 2 * meeting.radius < 0.3  # any two who are there hear each other
    assert rendezvous(Scenario()) is None
    assert rendezvous(Scenario(agents=1, comm_range=0.3)) is None


@given(unit, unit, unit, unit, st.floats(0, 2, width=32))
def test_whoever_has_budget_to_spare_ends_at_the_meeting(x, y, u, v, remaining):
    start, target = np.array([x, y]), np.array([u, v])
    left = float(
        spare(MEETING, jnp.asarray(start, jnp.float32), jnp.asarray(target, jnp.float32), jnp.float32(remaining))
    )
    length = np.linalg.norm(target - start)
    end = start + (target - start) * min(1.0, remaining / max(length, 1e-9))
    away = np.linalg.norm(end - np.asarray(MEETING.places[0])) - MEETING.radius
    if left >= 0:  # straight there is affordable, and the detour of a roadmap too
        assert min(length, remaining) + 1.1 * max(away, 0) <= remaining + 1e-4
    else:
        assert away > -1e-4


@given(st.lists(st.tuples(unit, unit, st.booleans()), min_size=1, max_size=6), st.floats(0, 2, width=32))
def test_only_targets_in_time_are_left_or_the_least_late_one(targets, remaining):
    start = jnp.array([0.2, 0.9])
    ends, allowed = jnp.array([t[:2] for t in targets]), jnp.array([t[2] for t in targets])
    left = np.asarray(spare(MEETING, start, ends, jnp.float32(remaining)))
    kept = np.asarray(in_time(MEETING, start, ends, allowed, jnp.float32(remaining)))
    assert not (kept & ~np.asarray(allowed)).any()
    assert kept.any() == bool(allowed.any())
    possible = left[np.asarray(allowed)]
    if (possible >= 0).any():
        assert (left[kept] >= -1e-5).all() and kept.sum() >= (possible >= 0).sum()
    elif len(possible):
        assert (left[kept] >= possible.max() - 1e-5).all()


@given(st.lists(st.tuples(unit, unit), min_size=2, max_size=2), st.floats(0.03125, 0.625, width=32))
def test_a_plan_in_the_plane_is_late_by_what_its_worst_leg_lacks(moves, remaining):
    start, steps = np.array([0.1, 0.2]), np.array([0.15, 0.2])
    ends = start + np.cumsum(0.2 * (np.array(moves) - 0.5), axis=0)
    at, worst = start, 0.0
    left = remaining
    for end, step in zip(ends, steps, strict=True):
        share = min(1.0, left / step)
        at, left = at + share * (end - at), max(0.0, left - step)
        worst = max(worst, np.linalg.norm(at - np.asarray(MEETING.places[0])) - MEETING.radius - left)
    late = lateness(MEETING, *map(lambda a: jnp.asarray(a, jnp.float32), (start, ends, steps, remaining)))
    assert float(late) == pytest.approx(float(max(worst, 0.0)), abs=1e-4)


@pytest.mark.parametrize("name", ["receding-horizon", "intent-search"])
def test_planners_in_the_plane_keep_the_meeting(name):
    scenario = Scenario(agents=3, budget=1.2, grid=10, nodes=40, neighbours=8, comm_range=0.4)
    options = {"horizon": 3, "candidates": 48, "elites": 4, "steps": 12}
    options |= {"weights": "untrained", "paths": 4, "nodes": 3} if name == "intent-search" else {}
    planner = make_planner(name, scenario, options)
    missions = draw_missions(scenario, seed=4, instances=4, planner=planner)
    states = run_missions(planner, missions, jax.random.key(0))
    assert (gaps(states) <= 0.4).all()


def gaps(states):
    """The largest distance between two agents at the end of each mission."""
    ends = np.take_along_axis(np.asarray(states.route), np.asarray(states.route_length)[..., None, None] - 1, axis=2)
    ends = ends[:, :, 0]
    return np.linalg.norm(ends[:, :, None] - ends[:, None], axis=-1).max(axis=(1, 2))


@pytest.mark.parametrize("meet", [True, False])
def test_agents_that_meet_end_within_range_and_know_all(tiny, meet):
    scenario = Scenario(agents=3, budget=1.6, grid=8, nodes=60, neighbours=10, comm_range=0.4)
    missions = draw_missions(scenario, seed=4, instances=6, encodings=4)
    planner = IntentPlanner.of(scenario, network=tiny, paths=2, steps=2, choose="sample", meet=meet)
    states = run_missions(planner, missions, jax.random.key(0))
    apart = gaps(states)
    metrics = score_missions(missions, states)
    same = np.isclose(metrics.own_trace, metrics.trace, rtol=1e-3)
    if meet:
        assert (apart <= 0.4).all() and same.all()
    else:
        assert (apart > 0.4).any() and not same.all()


def test_the_way_to_the_meeting_leads_around_zones():
    wall = ((0.4, 0.2), (0.45, 0.2), (0.45, 1.0), (0.4, 1.0))
    scenario = Scenario(comm_range=0.2, obstacles=(wall,), grid=21)
    meeting = rendezvous(scenario, zones_of(scenario))
    assert meeting is not None and meeting.lengths is not None
    # On points of the grid: one beside the meeting, one behind the wall.
    ends = jnp.array([[[0.6, 0.5]], [[0.3, 0.7]]])
    late = lateness(meeting, jnp.array([0.3, 0.7]), ends, jnp.ones(1), jnp.ones(()))
    around = np.hypot(0.1, 0.5) + 0.05 + np.hypot(0.05, 0.3)
    np.testing.assert_allclose(late, [0.1 - 0.098, around - 0.098], atol=0.005)
    slope = jax.grad(lambda ends: lateness(meeting, ends[0, 0], ends, jnp.ones(1), jnp.ones(())).sum())(ends)
    assert np.isfinite(slope).all()


def test_a_middle_in_a_zone_gives_way_to_what_is_free_next_to_it():
    square = ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6))
    zones = zones_of(Scenario(obstacles=(square,), grid=11, start=(0.1, 0.5)))
    assert zones is not None and np.isfinite(zones.to_middle).all()
    # Whichever side it is on, nobody has farther to go than around half of the square and to a corner of the domain.
    assert float(zones.to_middle.max()) < 0.4 + np.hypot(0.5, 0.5)
