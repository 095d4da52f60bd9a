"""The 8 symmetries of the square: what they do to points, and that the policy is shown the same world turned."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.fields.mixture import GaussianMixture, evaluation_grid
from maipp.roadmap import Obstacles
from maipp.training.config import TrainConfig
from maipp.training.learner import Learner
from maipp.training.random_zones import random_zones
from maipp.training.rollout import RolloutState, new_environment, step
from maipp.training.worlds import (
    TRAINING_SEEDS,
    agent_roadmap,
    draw_bank,
    draw_world,
    mission_of,
    seen_inside,
    training_scenario,
    turned,
)  # fmt: skip

# Where (0.1, 0.3) goes: bit 0 swaps x and y, then bit 1 mirrors x, bit 2 mirrors y.
IMAGES = [(0.1, 0.3), (0.3, 0.1), (0.9, 0.3), (0.7, 0.1), (0.1, 0.7), (0.3, 0.9), (0.9, 0.7), (0.7, 0.9)]

CONFIG = TrainConfig(
    agents=2, budget=(1.0, 1.0), bank=2, shards=1, missions=2, events=6, epochs=1, minibatch=12, paths=2, steps=2,
    imitation=0, search=0, updates=2,
)  # fmt: skip


def of(symmetry, points):
    return np.asarray(turned(jnp.int32(symmetry), jnp.asarray(points, jnp.float32)))


@pytest.mark.parametrize(("symmetry", "image"), list(enumerate(IMAGES)))
def test_each_symmetry_by_hand(symmetry, image):
    np.testing.assert_allclose(of(symmetry, (0.1, 0.3)), image, atol=1e-6)


def test_they_are_the_group_of_the_square():
    points = np.random.default_rng(0).uniform(size=(6, 2))
    images = [of(symmetry, points) for symmetry in range(8)]
    distances = np.linalg.norm(points[:, None] - points, axis=-1)
    for image in images:
        assert (image >= 0).all() and (image <= 1).all()
        np.testing.assert_allclose(np.linalg.norm(image[:, None] - image, axis=-1), distances, atol=1e-6)
        for again in range(8):  # two of them, one after the other, are one of them
            gaps = [np.abs(of(again, image) - other).max() for other in images]
            assert np.sum(np.less(gaps, 1e-5)) == 1


@pytest.fixture(scope="module")
def learner():
    return Learner(CONFIG, jax.devices()[:1])


@pytest.fixture(scope="module")
def blind(learner):
    """A planner whose network does not see where nodes lie, so that it does the same in a turned world."""
    network = learner.initial().network
    weight = network.embed.weight
    assert weight.shape == (5, network.width)
    network = eqx.tree_at(lambda n: n.embed.weight, network, weight.at[:2].set(0.0))
    return learner.planner(network)


def turned_world(world, symmetry):
    """The world as it is, unturned, seen in one of the symmetries: roadmap and field together."""
    field = world.field
    sigma = field.sigma[:, ::-1] if symmetry & 1 else field.sigma
    grid = evaluation_grid()
    field = GaussianMixture(turned(jnp.int32(symmetry), field.mean), sigma, present=field.present, grid=grid)
    return world._replace(field=field, truth=field(grid), symmetry=jnp.int32(symmetry))


def test_a_turned_world_looks_the_same_but_turned(learner, blind):
    """Six decisions of two agents in one world and in its seven images, drawn with the same keys.

    Offsets of nodes are turned; what the belief says of them, the others' intent, the edges, the value, the choice, the
    reward's trace and all that is remembered are the same up to rounding.
    """
    scenario = learner.scenario

    @eqx.filter_jit
    def play(planner, environment, keys):
        def event(environment, key):
            return step(CONFIG, scenario, planner, learner.bank, environment, key, "reinforce", 0.0)

        return jax.lax.scan(event, environment, keys)[1]

    keys = jax.random.split(jax.random.key(8), 6)
    drawn = new_environment(CONFIG, scenario, blind, learner.bank, jax.random.key(5))
    seen = []
    for symmetry in range(8):
        world = turned_world(drawn.world, symmetry)
        start = mission_of(learner.config, learner.bank, world).start
        np.testing.assert_allclose(start, of(symmetry, learner.bank.start[world.roadmap]), atol=1e-6)
        state = dataclasses.replace(
            drawn.state,
            leg=jnp.broadcast_to(start[:, None], drawn.state.leg.shape),
            route=drawn.state.route.at[:, 0].set(start),
        )
        seen.append(jax.tree.map(np.asarray, play(blind, RolloutState(world, state, drawn.plans), keys)))
    first = seen[0]
    assert first.features[2:, :, 4].any() and not first.ended.any() and np.ptp(first.trace) > 50
    for symmetry, other in enumerate(seen):
        offsets = of(symmetry, first.features[..., :2]) - of(symmetry, np.zeros(2))
        np.testing.assert_allclose(other.features[..., :2], offsets, atol=1e-5)
        for name in ("node", "neighbours", "allowed", "agent", "index", "stopped", "roadmap", "signs"):
            np.testing.assert_array_equal(getattr(other, name), getattr(first, name), err_msg=name)
        for name in ("neighbour_std", "remaining", "threshold", "value", "log_probability"):
            np.testing.assert_allclose(getattr(other, name), getattr(first, name), atol=2e-3, err_msg=name)
        np.testing.assert_allclose(other.features[..., 2:], first.features[..., 2:], atol=2e-3)
        np.testing.assert_allclose(other.memory.hidden, first.memory.hidden, atol=2e-3)
        np.testing.assert_allclose(other.trace, first.trace, rtol=1e-3)


def test_a_roadmap_is_turned_and_its_encoding_has_the_world_s_signs(learner):
    world = draw_world(CONFIG, learner.scenario, learner.bank, jax.random.key(2))
    world = world._replace(symmetry=jnp.int32(3))
    own = jax.tree.map(lambda a: np.asarray(a[world.roadmap, 1]), learner.bank.roadmap)
    shown = jax.tree.map(np.asarray, agent_roadmap(learner.bank, world, jnp.int32(1)))
    np.testing.assert_allclose(shown.nodes, np.stack([1 - own.nodes[:, 1], own.nodes[:, 0]], axis=1), atol=1e-6)
    for name in ("neighbours", "distances", "reachable"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(own, name))
    np.testing.assert_array_equal(shown.encoding, own.encoding * np.asarray(world.signs))
    ends = np.linalg.norm(shown.nodes[:, None] - shown.nodes[shown.neighbours], axis=-1)
    np.testing.assert_allclose(ends, shown.distances, atol=1e-6)


def test_worlds_are_drawn_from_all_that_the_configuration_allows(learner):
    config = CONFIG.replace(budget=(1.5, 5.0))
    draw = jax.jit(jax.vmap(lambda key: draw_world(config, learner.scenario, learner.bank, key)))
    worlds = jax.tree.map(np.asarray, draw(jax.random.split(jax.random.key(0), 200)))
    assert set(worlds.symmetry) == set(range(8)) and set(worlds.roadmap) == {0, 1}
    assert set(np.unique(worlds.signs)) == {-1.0, 1.0} and len(np.unique(worlds.signs, axis=0)) > 190
    budgets = worlds.params.budgets
    assert (budgets[:, 0] == budgets[:, 1]).all() and len(np.unique(budgets[:, 0])) > 190
    # 200 uniform draws: their mean deviates by sqrt((5 - 1.5)^2 / 12 / 200) = 0.07.
    assert budgets.min() >= 1.5 and budgets.max() <= 5.0 and budgets.mean() == pytest.approx(3.25, abs=0.3)
    assert TRAINING_SEEDS == 1_000_000_000


def test_zones_are_seen_as_the_roadmaps_are():
    config = CONFIG.replace(zones=(2, 4), bank=3)
    bank = draw_bank(config, training_scenario(config), 4)
    grid = np.asarray(evaluation_grid(30, jnp.ones(2)))
    for row in range(3):
        zones = random_zones(np.random.default_rng([TRAINING_SEEDS + config.seed, row]), (2, 4))
        assert Obstacles(zones).free(np.asarray(bank.roadmap.nodes[row], float).reshape(-1, 2)).all()
        for symmetry in range(8):
            world = draw_world(config, training_scenario(config), bank, jax.random.key(0))
            world = world._replace(roadmap=jnp.int32(row), symmetry=jnp.int32(symmetry))
            image = [np.asarray(of(symmetry, zone)) for zone in zones]
            seen = np.asarray(seen_inside(bank, world, 30))
            # Points of the grid on a border may fall to either side in single precision.
            assert (seen == Obstacles(image).free(grid)).mean() > 0.995 and not seen.all()


def test_random_zones_are_polygons():
    for seed in range(300):
        zones = random_zones(np.random.default_rng(seed), (0, 4))
        assert len(Obstacles(zones)) == len(zones) <= 4
