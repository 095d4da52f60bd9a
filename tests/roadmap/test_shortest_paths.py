"""Shortest ways around no-go zones, from anywhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from maipp.roadmap import Obstacles, zones_of
from maipp.roadmap.shortest_paths import longest_free_leg, shortest_paths, waypoints
from maipp.scenario import Scenario
from tests.shared.random_areas import CORNERS, EDGES, random_area

ways_ = jax.jit(lambda zones, here: shortest_paths(zones, here, zones.places, zones.to_place))
points_ = jax.jit(jax.vmap(waypoints, (None, None, 0)))
run_ = jax.jit(lambda zones, here: longest_free_leg(zones, here, jnp.asarray(0.2), (1.0, 1.0)))


def dense_ways(obstacles, points, radius):
    """Lengths of the ways from the first point, over a dense graph of points: never shorter than the shortest."""
    offset = np.linalg.norm(points[:, None] - points, axis=-1)
    i, j = np.nonzero(np.triu(offset < radius, 1))
    free = ~obstacles.crosses(points[i], points[j])
    graph = csr_array((offset[i, j][free], (i[free], j[free])), shape=offset.shape)
    return dijkstra(graph, directed=False, indices=0)


@pytest.mark.parametrize("seed", range(8))
def test_ways_keep_out_and_are_no_longer_than_over_a_dense_graph(seed):
    area = random_area(seed)
    obstacles, zones = Obstacles(area.scenario.obstacles), zones_of(area.scenario, EDGES, CORNERS)
    assert zones is not None
    here = jnp.asarray(area.scenario.start, jnp.float32)
    ways = ways_(zones, here)
    points = np.asarray(points_(zones, ways, jnp.arange(len(zones.places))), float)
    found = np.isfinite(ways.length)
    assert found.sum() >= 20
    for index in np.flatnonzero(found):
        way = np.concatenate([np.asarray(here, float)[None], points[index]])
        legs = np.linalg.norm(np.diff(way, axis=0), axis=1)
        moved = legs > 0
        assert not obstacles.crosses(way[:-1][moved], way[1:][moved]).any()
        if (way[-1] == np.asarray(ways.ends[index])).all():  # the end is among the first waypoints
            assert legs.sum() == pytest.approx(float(ways.length[index]), abs=1e-5)
    lattice = np.stack(np.meshgrid(*[np.linspace(0, 1, 34)] * 2), axis=-1).reshape(-1, 2)
    lattice = lattice[obstacles.free(lattice)]
    ends = np.asarray(zones.places, float)
    dense = dense_ways(obstacles, np.concatenate([np.asarray(here, float)[None], lattice, ends]), 0.08)[-len(ends) :]
    both = found & np.isfinite(dense)
    assert (np.asarray(ways.length)[both] <= dense[both] + 0.01).all()
    # What is well within the room of the start is reached.
    inner = shapely.contains_xy(area.free.buffer(-0.005), ends[:, 0], ends[:, 1])
    assert found[inner].all()


def test_a_way_straight_to_a_point_in_sight():
    zones = zones_of(Scenario(obstacles=(((0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)),), grid=10))
    here = jnp.array([0.1, 0.1])
    ways = ways_(zones, here)
    assert int(ways.first[0]) == -1
    assert float(ways.length[0]) == pytest.approx(np.hypot(0.1, 0.1), abs=1e-6)
    # And around the square to the opposite corner of the domain.
    assert int(ways.first[-1]) >= 0
    assert float(ways.length[-1]) == pytest.approx(np.hypot(0.5, 0.3) + np.hypot(0.4, 0.6), abs=5e-3)


def test_the_longest_leg_out_of_a_corridor_is_along_it():
    zones = zones_of(
        Scenario(
            obstacles=(
                ((0.0, 0.0), (1.0, 0.0), (1.0, 0.48), (0.0, 0.48)),
                ((0.0, 0.52), (1.0, 0.52), (1.0, 1.0), (0.0, 1.0)),
            )
        )
    )
    end = run_(zones, jnp.array([0.5, 0.5]))
    assert abs(float(end[0]) - 0.5) == pytest.approx(0.2, abs=1e-4)
