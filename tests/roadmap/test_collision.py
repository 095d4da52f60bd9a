"""How far legs go before they would enter a no-go zone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.planners.plane.walks import bend, walk_bent
from maipp.roadmap import Obstacles, zones_of
from maipp.roadmap.collision import collision_free_share, cut
from maipp.roadmap.zones import CLEARANCE
from maipp.scenario import Scenario
from tests.shared.random_areas import CORNERS, EDGES, random_area

SEEDS = st.integers(0, 199)
LEGS = 256
SQUARE = ((0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75))

cut_ = jax.jit(cut)
walk_ = jax.jit(lambda zones, start, plans, steps: walk_bent(start, plans, steps, (1.0, 1.0), zones))
bend_ = jax.jit(
    jax.vmap(lambda zones, start, end, length: bend(start, end, length, (1.0, 1.0), zones), (None, 0, 0, 0))
)


def free_points(obstacles, rng, count):
    points = rng.random((20 * count, 2)).astype(np.float32)
    return points[obstacles.free(points.astype(float))][:count]


def crossed(obstacles, start, end):
    start, end = np.asarray(start, float), np.asarray(end, float)
    moved = (start != end).any(axis=-1)
    return obstacles.crosses(start[moved], end[moved]).any()


@settings(max_examples=25)
@given(SEEDS)
def test_what_is_left_of_a_leg_crosses_no_zone_and_little_is_lost(seed):
    scenario = random_area(seed).scenario
    obstacles, zones = Obstacles(scenario.obstacles), zones_of(scenario, EDGES, CORNERS)
    assert zones is not None
    rng = np.random.default_rng(seed)
    start = free_points(obstacles, rng, LEGS)
    end = rng.random((len(start), 2)).astype(np.float32)
    last = np.asarray(cut_(zones.borders, start, end))
    assert not crossed(obstacles, start, last)
    # A leg stops for nothing but what is near: its end, or a place just beside the way.
    legs = np.asarray(shapely.linestrings(np.stack([start, last], axis=1).astype(float)))
    stopped = (last != end).any(axis=1)
    assert (shapely.distance(obstacles.union, legs[stopped]) < 3 * CLEARANCE).all()
    whole = shapely.linestrings(np.stack([start, end], axis=1).astype(float))
    assert not stopped[shapely.distance(obstacles.union, whole) > 3 * CLEARANCE].any()


@settings(max_examples=25)
@given(SEEDS)
def test_bent_legs_and_whole_plans_keep_out(seed):
    scenario = random_area(seed).scenario
    obstacles, zones = Obstacles(scenario.obstacles), zones_of(scenario, EDGES, CORNERS)
    assert zones is not None
    rng = np.random.default_rng(seed)
    start = jnp.asarray(free_points(obstacles, rng, 1)[0])
    plans = jnp.asarray(rng.normal(size=(64, 4, 2)), jnp.float32)
    steps = jnp.full(4, 0.2)
    points = walk_(zones, start, plans, steps)
    begins = jnp.concatenate([jnp.broadcast_to(start, (64, 1, 2)), points[:, :-1]], axis=1).reshape(-1, 2)
    ends = points.reshape(-1, 2)
    assert not crossed(obstacles, begins, ends)
    corners = bend_(zones, begins, ends, jnp.full(len(ends), 0.2))
    assert not crossed(obstacles, begins, corners) and not crossed(obstacles, corners, ends)
    straight = (corners == ends).all(axis=1)
    way = np.linalg.norm(corners - begins, axis=1) + np.linalg.norm(ends - corners, axis=1)
    np.testing.assert_allclose(way[~straight], 0.2, atol=1e-5)


def test_whoever_stands_on_a_border_may_go_away_but_not_in():
    zones = zones_of(Scenario(obstacles=(SQUARE,)))
    assert zones is not None
    start = jnp.array([[0.25, 0.5], [0.5, 0.25], [0.2495, 0.5]])
    away = jnp.array([[0.05, 0.6], [0.6, 0.05], [0.05, 0.4]])
    into = jnp.array([[0.45, 0.6], [0.6, 0.45], [0.45, 0.4]])
    np.testing.assert_array_equal(cut_(zones.borders, start, away), away)
    last = cut_(zones.borders, start, into)
    assert (np.linalg.norm(last - start, axis=1) < 2e-3).all()
    assert not crossed(Obstacles([SQUARE]), start, last)


@pytest.mark.parametrize("angle", 0.1 + np.linspace(0, 2 * np.pi, 24, endpoint=False))
def test_a_leg_from_a_corner_is_stopped_only_where_it_leads_into_the_zone(angle):
    zones = zones_of(Scenario(obstacles=(SQUARE,)))
    assert zones is not None
    corner = jnp.array([0.25, 0.25])
    end = corner + 0.2 * jnp.array([np.cos(angle), np.sin(angle)])
    share = float(collision_free_share(zones.borders, corner, end))
    assert share == (0.0 if angle < np.pi / 2 else 1.0)


def test_no_leg_slips_through_a_corner():
    zones = zones_of(Scenario(obstacles=(SQUARE,)))
    assert zones is not None
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    corner = np.array([0.25, 0.25])
    start = np.clip(corner - 0.2 * np.stack([np.cos(angle), np.sin(angle)], axis=1), 0, 1).astype(np.float32)
    free = Obstacles([SQUARE]).free(start.astype(float))
    end = (2 * corner - start).astype(np.float32)
    last = cut_(zones.borders, start[free], end[free])
    assert not crossed(Obstacles([SQUARE]), start[free], last)


def test_slopes_stay_finite_at_a_wall():
    zones = zones_of(Scenario(obstacles=(SQUARE,)))
    assert zones is not None
    plans = jnp.array([[[1.0, 0.0], [1.0, 0.0]], [[0.5, 0.0], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]]])

    def total(plans):
        return jnp.sum(walk_bent(jnp.array([0.1, 0.5]), plans, jnp.full(2, 0.2), (1.0, 1.0), zones) ** 2)

    assert np.isfinite(jax.grad(total)(plans)).all()
