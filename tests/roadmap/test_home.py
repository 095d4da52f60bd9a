"""Shortest ways home around no-go zones, from anywhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import shapely

from maipp.errors import InputError
from maipp.roadmap import Home, Obstacles, free_space, home_of, lengths_home
from maipp.roadmap.home import WAYPOINTS, path_home
from tests.shared.random_areas import random_area

lengths_ = jax.jit(lengths_home)
ways_ = jax.jit(jax.vmap(path_home, (None, 0)))
SQUARE = ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6))


def of_agent(home, agent=0):
    return Home(jax.tree.map(lambda array: array[agent], home.ends), home.borders)


@pytest.mark.parametrize("seed", range(6))
def test_ways_home_keep_out_and_are_the_shortest(seed):
    """The compiled ways against those that Shapely and SciPy find on the host, at most a clearance's rounding apart."""
    scenario, room = random_area(seed)
    inner = room.buffer(-0.01)
    rng, points = np.random.default_rng(seed), []
    while len(points) < 12:
        point = rng.random(2)
        if shapely.contains_xy(inner, *point):
            points.append(point)
    end, starts = tuple(points[0].tolist()), np.array(points[1:], np.float32)
    home = of_agent(home_of([[end]], scenario.obstacles, (1.0, 1.0), 10))
    lengths = np.asarray(lengths_(home, starts))
    expected = free_space(scenario.obstacles, (1.0, 1.0)).lengths_to(starts.astype(float), np.array(end))
    assert np.isfinite(lengths).all()
    np.testing.assert_allclose(lengths, expected, atol=2e-3)
    obstacles = Obstacles(scenario.obstacles)
    for start, length in zip(starts, lengths, strict=True):
        way, here = [start.astype(float)], start
        while np.linalg.norm(here - np.asarray(end, np.float32)) > 1e-6:  # whoever travels looks again
            way += list(np.asarray(ways_(home, here[None])[0], float))
            here = np.float32(way[-1])
            assert len(way) < 10 * WAYPOINTS
        way = np.array(way)
        legs = np.hypot(*np.diff(way, axis=0).T)
        moved = legs > 0
        assert not obstacles.crosses(way[:-1][moved], way[1:][moved]).any()
        assert legs.sum() == pytest.approx(length, abs=1e-5)


def test_any_of_several_places_will_do_and_without_any_an_agent_is_not_bound():
    home = home_of([[(0.1, 0.5), (0.9, 0.5)], [], [(0.5, 0.9)]], (SQUARE,), (1.0, 1.0), 10)
    assert home.ends.bound.tolist() == [True, False, True]
    lengths = np.asarray(lengths_(of_agent(home), jnp.array([[0.2, 0.5], [0.8, 0.5]])))
    np.testing.assert_allclose(lengths, 0.1, atol=1e-6)
    ways = np.asarray(ways_(of_agent(home), jnp.array([[0.2, 0.5], [0.8, 0.5]])))
    np.testing.assert_allclose(ways[:, -1], [[0.1, 0.5], [0.9, 0.5]], atol=1e-6)
    third = float(lengths_(of_agent(home, 2), jnp.array([[0.5, 0.1]]))[0])
    assert third == pytest.approx(2 * np.hypot(0.1, 0.3) + 0.2, abs=5e-3)


def test_a_place_at_the_edge_of_a_zone_is_reached_and_one_within_is_refused():
    home = of_agent(home_of([[(0.5, 0.4)]], (SQUARE,), (1.0, 1.0), 10))
    way = np.asarray(ways_(home, jnp.array([[0.5, 0.9]]))[0])
    np.testing.assert_allclose(way[-1], [0.5, 0.4], atol=1e-6)
    # Whoever is there is at home, and does not go out to where ways end and back.
    np.testing.assert_allclose(ways_(home, jnp.array([[0.5, 0.4]]))[0], np.full((WAYPOINTS, 2), [0.5, 0.4]), atol=1e-6)
    assert float(lengths_(home, jnp.array([[0.5, 0.4]]))[0]) < 1e-6
    assert np.isfinite(np.asarray(home.ends.lengths)).all()
    with pytest.raises(InputError, match=r"end\[1\]: \(0.5, 0.5\) lies within a no-go zone"):
        home_of([[(0.1, 0.1)], [(0.5, 0.5)]], (SQUARE,), (1.0, 1.0), 10)


def test_without_zones_ways_are_straight():
    home = of_agent(home_of([[(0.0, 0.0)]], (), (1.0, 1.0), 10))
    assert home.borders is None and home.ends.lengths is None
    np.testing.assert_allclose(lengths_(home, jnp.array([[0.3, 0.4]])), 0.5, atol=1e-6)
    np.testing.assert_allclose(ways_(home, jnp.array([[0.3, 0.4]])), np.zeros((1, WAYPOINTS, 2)), atol=0)
