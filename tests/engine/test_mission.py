"""Drawing worlds: the same seed and instance give the same world, however many are drawn and for whatever planner."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine import draw_missions
from maipp.roadmap import Obstacles, laplacian_encoding
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=2, budget=(0.5, 0.8), speed=(1.0, 2.0), grid=9, nodes=15, neighbours=4, extent=(2.0, 1.0))
WALL = ((0.9, 0.0), (1.1, 0.0), (1.1, 0.8), (0.9, 0.8))


@pytest.fixture(scope="module")
def batch():
    """Three instances, two trials each: missions 2 i and 2 i + 1 are instance i."""
    return draw_missions(SCENARIO, seed=5, instances=3, trials=2)


def row(missions, i):
    return jax.tree.map(lambda a: np.asarray(a[i]), missions)


def assert_same_world(a, b, atol=1e-6):
    """Everything but the roadmaps."""
    for name in ("field", "grid", "truth", "inside", "start", "params"):
        for x, y in zip(jax.tree.leaves(getattr(a, name)), jax.tree.leaves(getattr(b, name)), strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-6, atol=atol)


def test_shapes_and_contents(batch):
    assert batch.truth.shape == (6, 81) and batch.start.shape == (6, 2, 2)
    assert batch.roadmap.nodes.shape == (6, 2, 15, 2) and batch.roadmap.neighbours.shape == (6, 2, 15, 4)
    assert (batch.start >= 0).all() and (batch.start <= jnp.array([2.0, 1.0])).all()
    np.testing.assert_array_equal(batch.start[:, 0], batch.start[:, 1])  # a drawn start is shared
    np.testing.assert_allclose(batch.params.budgets, np.tile([0.5, 0.8], (6, 1)))
    np.testing.assert_allclose(batch.params.speeds, np.tile([1.0, 2.0], (6, 1)))
    np.testing.assert_allclose(batch.grid[0, -1], [2.0, 1.0])
    for i in range(6):
        world = jax.tree.map(lambda a, i=i: a[i], batch)
        np.testing.assert_allclose(world.field(world.grid), world.truth, atol=1e-6)
        assert float(world.truth.max()) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(("instances", "trials"), [(1, 1), (2, 3)])
def test_a_world_does_not_depend_on_how_many_are_drawn(batch, instances, trials):
    fewer = draw_missions(SCENARIO, seed=5, instances=instances, trials=trials)
    for i in range(instances):
        assert_same_world(row(fewer, i * trials), row(batch, 2 * i))
        for trial in range(min(trials, 2)):
            for a, b in zip(
                jax.tree.leaves(row(fewer, i * trials + trial).roadmap),
                jax.tree.leaves(row(batch, 2 * i + trial).roadmap),
                strict=True,
            ):
                np.testing.assert_array_equal(a, b)


def test_trials_share_field_and_start_but_not_roadmaps(batch):
    for i in range(3):
        one, other = row(batch, 2 * i), row(batch, 2 * i + 1)
        assert_same_world(one, other, atol=0)
        nodes, others = one.roadmap.nodes, other.roadmap.nodes
        np.testing.assert_allclose(nodes[:, 0], one.start, atol=1e-7)  # node 0 is the start, of every agent's
        np.testing.assert_allclose(others[:, 0], one.start, atol=1e-7)
        assert not np.isclose(nodes[:, 1:], others[:, 1:]).all(axis=-1).any()
        assert not np.isclose(nodes[0, 1:], nodes[1, 1:]).all(axis=-1).any()  # nor do agents share theirs


def test_planners_with_and_without_roadmaps_meet_the_same_worlds(batch):
    bare = draw_missions(SCENARIO, seed=5, instances=3, trials=2, roadmaps=False)
    assert bare.roadmap is None
    assert_same_world(bare, batch, atol=0)


def test_encodings_are_those_of_the_roadmaps_and_change_nothing_else(batch):
    encoded = draw_missions(SCENARIO, seed=5, instances=3, trials=2, encodings=6)
    assert batch.roadmap.encoding is None and encoded.roadmap is not None
    assert encoded.roadmap.encoding is not None and encoded.roadmap.encoding.shape == (6, 2, 15, 6)
    assert_same_world(encoded, batch, atol=0)
    for name in ("nodes", "neighbours", "distances", "reachable"):
        np.testing.assert_array_equal(getattr(encoded.roadmap, name), getattr(batch.roadmap, name))
    for i, agent in ((0, 0), (3, 1)):
        roadmap = jax.tree.map(lambda a, i=i, agent=agent: np.asarray(a[i, agent]), encoded.roadmap)
        np.testing.assert_allclose(roadmap.encoding, laplacian_encoding(roadmap, 6), atol=1e-6)


def test_instances_and_seeds_differ(batch):
    starts = np.asarray(batch.start[::2, 0])
    assert len(np.unique(starts, axis=0)) == 3
    assert len(np.unique(np.asarray(batch.truth[::2]), axis=0)) == 3
    other = draw_missions(SCENARIO, seed=6, instances=1, roadmaps=False)
    assert not np.allclose(other.truth[0], batch.truth[0], atol=0.05)
    assert not np.allclose(other.start[0], batch.start[0])


def test_the_scenario_of_the_team_does_not_change_the_world():
    """Comparing two, three and ten agents is only fair on the same fields."""
    one = draw_missions(SCENARIO, seed=5, instances=2, roadmaps=False)
    other = draw_missions(
        SCENARIO.replace(agents=4, budget=0.3, speed=1.0, comm_range=0.1, length_scale=0.2),
        seed=5,
        instances=2,
        roadmaps=False,
    )
    np.testing.assert_allclose(one.truth, other.truth, atol=1e-6)
    np.testing.assert_array_equal(one.start[:, 0], other.start[:, 3])


@pytest.mark.parametrize("start", [(0.25, 0.5), ((0.25, 0.5), (1.75, 0.125))])
def test_given_starts_are_used(start):
    missions = draw_missions(SCENARIO.replace(start=start), seed=5, instances=2)
    np.testing.assert_array_equal(missions.start, np.broadcast_to(np.asarray(start, np.float32), (2, 2, 2)))
    assert missions.roadmap is not None
    np.testing.assert_array_equal(missions.roadmap.nodes[:, :, 0], missions.start)


def test_a_given_field_replaces_the_mixture(batch):
    field = jax.tree.map(lambda a: a[0], batch.field)
    missions = draw_missions(SCENARIO, seed=9, instances=2, trials=2, field=field)
    np.testing.assert_allclose(missions.truth, np.tile(batch.truth[0], (4, 1)), atol=1e-6)
    assert len(np.unique(np.asarray(missions.start[::2, 0]), axis=0)) == 2
    world = jax.tree.map(lambda a: a[3], missions)
    np.testing.assert_allclose(world.field(world.grid), batch.truth[0], atol=1e-6)


def test_starts_and_grid_keep_out_of_no_go_zones():
    scenario = SCENARIO.replace(obstacles=(WALL,), agents=1, budget=0.5, speed=1.0)
    missions = draw_missions(scenario, seed=0, instances=40, roadmaps=False)
    obstacles = Obstacles(scenario.obstacles)
    assert obstacles.free(np.asarray(missions.start[:, 0])).all()
    np.testing.assert_array_equal(missions.inside[0], obstacles.free(np.asarray(missions.grid[0])))
    assert 0 < (~missions.inside[0]).sum() < 81
    # An obstacle moves only the starts that were inside it.
    free = draw_missions(scenario.replace(obstacles=()), seed=0, instances=40, roadmaps=False)
    kept = obstacles.free(np.asarray(free.start[:, 0]))
    assert 0 < kept.sum() < 40
    np.testing.assert_array_equal(missions.start[kept], free.start[kept])
    np.testing.assert_array_equal(missions.truth, free.truth)


def test_obstacles_without_room_for_a_start_are_refused():
    everywhere = ((-1.0, -1.0), (3.0, -1.0), (3.0, 2.0), (-1.0, 2.0))
    with pytest.raises(ValueError, match="no room to start"):
        draw_missions(SCENARIO.replace(obstacles=(everywhere,)), seed=0, instances=1, roadmaps=False)
