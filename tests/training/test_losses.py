"""What training minimises: values and gradients against the formulas, in float64 and by finite differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.policy import Memory, PolicyNetwork, Prepared
from maipp.roadmap import Roadmap
from maipp.training.config import TrainConfig
from maipp.training.losses import PolicyExample, sample_loss
from maipp.training.rollout import Transition
from maipp.training.search import Elites
from maipp.training.worlds import Bank

NODES, NEIGHBOURS, ENCODINGS = 5, 4, 4
PPO = TrainConfig(clip=0.2, entropy=0.0, value=0.0)
LOGITS = np.array([0.3, -0.5, 1.1, 0.0])
ALLOWED = np.array([True, True, True, False])
OLD = np.log(0.3)  # the log-probability that the choice had when it was made


class Table(PolicyNetwork):
    """A network whose weights are its answers: the logits of the neighbours, and the value."""

    scores: jax.Array
    worth: jax.Array

    def __init__(self, scores: np.ndarray, worth: float = 0.0) -> None:
        super().__init__(jax.random.key(0), width=4, heads=1, encoding_dimensions=ENCODINGS)
        self.scores, self.worth = jnp.asarray(scores, jnp.float32), jnp.float32(worth)

    def decode(
        self, prepared: Prepared, current, neighbours, allowed, neighbour_std, remaining, threshold, memory: Memory
    ) -> tuple[jax.Array, jax.Array, Memory]:
        """The table's answer."""
        return jnp.where(allowed, self.scores, -jnp.inf), self.worth, memory


def bank():
    """One roadmap, of which only the encoding is read."""
    nodes, of_edges = np.zeros((1, 1, NODES, 2), np.float32), (1, 1, NODES, NEIGHBOURS)
    encoding = np.random.default_rng(3).normal(size=(1, 1, NODES, ENCODINGS)).astype(np.float32)
    edges = np.zeros(of_edges, np.int32), np.zeros(of_edges, np.float32), np.ones(of_edges, bool)
    return jax.tree.map(jnp.asarray, Bank(Roadmap(nodes, *edges, encoding), jnp.zeros((1, 1, 2))))


def sample(
    network, *, advantage=0.0, target=0.0, valid=True, index=0, old=OLD, allowed=ALLOWED, lesson=None, elites=None
):
    zero, lesson = jnp.int32(0), np.zeros(NEIGHBOURS) if lesson is None else lesson
    transition = Transition(
        features=jnp.asarray(np.random.default_rng(4).normal(size=(NODES, 5)), jnp.float32),
        roadmap=zero,
        agent=zero,
        signs=jnp.ones(ENCODINGS),
        node=zero,
        neighbours=jnp.array([1, 2, 3, 4]),
        allowed=jnp.asarray(allowed),
        neighbour_std=jnp.linspace(0.2, 0.8, NEIGHBOURS),
        remaining=jnp.float32(0.7),
        threshold=jnp.float32(0.4),
        memory=network.initial_memory(),
        index=jnp.int32(index),
        log_probability=jnp.float32(old),
        value=jnp.float32(0.0),
        lesson=jnp.asarray(lesson, jnp.float32),
        elites=elites,
        trace=jnp.float32(1.0),
        stopped=jnp.asarray(False),
        ended=jnp.asarray(False),
    )
    return PolicyExample(transition, jnp.float32(advantage), jnp.float32(target), jnp.asarray(valid))


BANK = bank()


@eqx.filter_jit
def slope(config, network, of, phase):
    """Loss, parts and gradient of one decision."""

    def loss(network):
        return sample_loss(config, network, BANK, of, phase)

    (value, parts), gradient = eqx.filter_value_and_grad(loss, has_aux=True)(network)
    return value, parts, gradient


def chances(logits, allowed=ALLOWED):
    powers = np.where(allowed, np.exp(logits), 0.0)
    return powers / powers.sum()


def finite_differences(loss, at, step=1e-6):
    """The central ones, in float64: right to about 1e-10."""
    steps = step * np.eye(len(at))
    return np.array([(loss(at + one) - loss(at - one)) / (2 * step) for one in steps])


def clipped_surrogate(logits, ratio_at, advantage, index=0, clip=0.2):
    """The loss of Schulman et al. 2017, eq. 7; `ratio_at` is the probability ratio at LOGITS."""
    ratio = chances(logits)[index] / chances(LOGITS)[index] * ratio_at
    return -min(ratio * advantage, np.clip(ratio, 1 - clip, 1 + clip) * advantage)


@pytest.mark.parametrize("advantage", [1.5, -1.5])
@pytest.mark.parametrize("ratio", [0.6, 0.79, 0.81, 1.0, 1.19, 1.21, 1.7])
def test_ppo_follows_the_ratio_until_it_gained_enough(ratio, advantage):
    old = np.log(chances(LOGITS)[0] / ratio)
    network = Table(LOGITS)
    loss, parts, gradient = slope(PPO, network, sample(network, advantage=advantage, old=old), "reinforce")
    assert float(loss) == pytest.approx(clipped_surrogate(LOGITS, ratio, advantage), rel=1e-5)
    expected = finite_differences(lambda logits: clipped_surrogate(logits, ratio, advantage), LOGITS)
    np.testing.assert_allclose(gradient.scores, expected, atol=2e-6)
    # By hand: -A r (1 - p) for the choice's own logit, and nothing beyond the clip where there is no more to gain.
    spent = ratio > 1.2 if advantage > 0 else ratio < 0.8
    own = 0.0 if spent else -advantage * ratio * (1 - chances(LOGITS)[0])
    assert float(gradient.scores[0]) == pytest.approx(own, abs=2e-6)
    assert float(gradient.worth) == 0.0
    assert float(parts["policy_loss"]) == pytest.approx(float(loss))
    assert float(parts["clip_fraction"]) == (abs(ratio - 1) > 0.2)
    assert float(parts["kl"]) == pytest.approx(ratio - 1 - np.log(ratio), abs=1e-6)


def test_a_good_choice_becomes_likelier_and_a_bad_one_less_likely():
    network = Table(LOGITS)
    for advantage, sign in ((1.0, 1), (-1.0, -1)):
        gradient = slope(
            PPO, network, sample(network, advantage=advantage, old=np.log(chances(LOGITS)[0])), "reinforce"
        )[2]
        moved = chances(LOGITS - 0.1 * np.asarray(gradient.scores, float))
        assert sign * (moved[0] - chances(LOGITS)[0]) > 0.01


def test_the_value_is_fitted_to_its_target():
    network, config = Table(LOGITS, worth=2.0), PPO.replace(value=0.5)
    loss, parts, gradient = slope(config, network, sample(network, target=5.0), "reinforce")
    assert float(loss) == pytest.approx(0.5 * 0.5 * 3.0**2) and float(parts["value_loss"]) == pytest.approx(4.5)
    assert float(gradient.worth) == pytest.approx(0.5 * (2.0 - 5.0))  # descending raises it
    np.testing.assert_array_equal(gradient.scores, np.zeros(4))


def test_the_entropy_bonus_makes_choices_more_even():
    def bonus(logits):
        p = chances(logits)[:3]
        return 0.1 * np.sum(p * np.log(p))  # minus the entropy

    network = Table(LOGITS)
    loss, parts, gradient = slope(PPO.replace(entropy=0.1), network, sample(network), "reinforce")
    assert float(loss) == pytest.approx(bonus(LOGITS), rel=1e-5)
    assert float(parts["entropy"]) == pytest.approx(-10 * bonus(LOGITS), rel=1e-5)
    np.testing.assert_allclose(gradient.scores, finite_differences(bonus, LOGITS), atol=1e-6)
    assert bonus(LOGITS - np.asarray(gradient.scores, float)) < bonus(LOGITS)


def test_a_decision_without_a_known_outcome_has_no_say_in_policy_and_value():
    network = Table(LOGITS, worth=2.0)
    unknown = sample(network, advantage=3.0, target=9.0, valid=False)
    loss, parts, gradient = slope(PPO.replace(value=0.5), network, unknown, "reinforce")
    told = {name: float(part) for name, part in parts.items() if name != "entropy"}
    assert told == dict.fromkeys(told, 0.0) and float(loss) == 0.0
    assert all(not np.any(leaf) for leaf in jax.tree.leaves(gradient))


@pytest.mark.parametrize("phase", ["reinforce", "imitate"])
def test_an_agent_with_nowhere_to_go_teaches_nothing(phase):
    network = Table(LOGITS, worth=2.0)
    stuck = sample(network, valid=False, allowed=np.zeros(4, bool), old=0.0)
    loss, _, gradient = slope(TrainConfig(), network, stuck, phase)
    assert float(loss) == 0.0 and all(not np.any(leaf) for leaf in jax.tree.leaves(gradient))


def test_imitation_is_the_cross_entropy_from_the_lesson():
    lesson = np.array([0.7, 0.1, 0.2, 0.0])

    def distance(logits):
        return -np.sum(lesson[:3] * np.log(chances(logits)[:3]))

    network = Table(LOGITS)
    loss, parts, gradient = slope(PPO, network, sample(network, lesson=lesson, advantage=7.0), "imitate")
    assert float(loss) == pytest.approx(distance(LOGITS), rel=1e-5)
    assert float(parts["imitation_loss"]) == pytest.approx(distance(LOGITS), rel=1e-5)
    np.testing.assert_allclose(gradient.scores, finite_differences(distance, LOGITS), atol=1e-6)
    np.testing.assert_allclose(gradient.scores, chances(LOGITS) - lesson, atol=1e-6)


def two_paths():
    """Three steps each: the first path takes two of them, the second one."""
    at = jnp.zeros((2, 3), jnp.int32)
    return Elites(
        index=jnp.array([[2, 0, 1], [1, 0, 0]], jnp.int32),
        taken=jnp.array([[True, True, False], [True, False, False]]),
        node=at,
        neighbours=jnp.broadcast_to(jnp.array([1, 2, 3, 4]), (2, 3, 4)),
        allowed=jnp.broadcast_to(jnp.asarray(ALLOWED), (2, 3, 4)),
        neighbour_std=jnp.full((2, 3, 4), 0.5),
        remaining=jnp.full((2, 3), 0.5),
    )


def test_the_search_makes_the_steps_of_its_best_paths_likelier():
    def surprise(logits):
        logs = np.log(chances(logits)[:3])
        return -(logs[2] + logs[0] + logs[1]) / 2  # mean over the two paths

    network = Table(LOGITS)
    of = sample(network, elites=two_paths(), lesson=[0.0, 0.0, 1.0, 0.0], advantage=7.0)
    loss, parts, gradient = slope(PPO, network, of, "search")
    assert float(loss) == pytest.approx(surprise(LOGITS), rel=1e-5)
    assert float(parts["imitation_loss"]) == pytest.approx(surprise(LOGITS), rel=1e-5)
    np.testing.assert_allclose(gradient.scores, finite_differences(surprise, LOGITS), atol=1e-6)


@pytest.mark.parametrize(
    ("phase", "own"),
    [
        ("reinforce", {"policy_loss", "kl", "clip_fraction"}),
        ("imitate", {"imitation_loss"}),
        ("search", {"imitation_loss"}),
    ],
)
def test_a_phase_tells_what_means_something_in_it(phase, own):
    network = Table(LOGITS)
    of = sample(network, elites=two_paths() if phase == "search" else None)
    assert slope(PPO, network, of, phase)[1].keys() == {"loss", "value_loss", "entropy"} | own


@pytest.mark.parametrize("phase", ["reinforce", "imitate", "search"])
def test_the_gradient_reaches_all_of_the_network(phase):
    """Along any direction d of unit length the loss changes by g . d per unit, as differences of the loss itself say.

    The step of 1e-2 changes a loss of order 1 by about 1e-2: float32 rounds the difference to 1e-5 of that, the third
    derivative adds 1e-4 of it. A random direction, unlike that of g, sees a part of the loss that g leaves out.
    """
    network = PolicyNetwork(jax.random.key(5), width=8, heads=2, encoding_dimensions=ENCODINGS)
    config = TrainConfig(entropy=0.05)
    of = sample(
        network,
        advantage=1.3,
        target=2.0,
        old=np.log(0.35),
        lesson=[0.6, 0.4, 0.0, 0.0],
        elites=two_paths() if phase == "search" else None,
    )
    _, _, gradient = slope(config, network, of, phase)
    assert all(np.any(leaf) for leaf in jax.tree.leaves(gradient.embed))  # the first layer, too

    def dot(a, b):
        return sum(float(jnp.sum(x * y)) for x, y in zip(*map(jax.tree.leaves, (a, b)), strict=True))

    def along(direction, step):
        return float(slope(config, jax.tree.map(lambda w, d: w + step * d, network, direction), of, phase)[0])

    leaves, structure = jax.tree.flatten(network)
    draw = np.random.default_rng(6).normal
    for _ in range(3):
        random = jax.tree.unflatten(structure, [jnp.asarray(draw(size=leaf.shape), leaf.dtype) for leaf in leaves])
        size = np.sqrt(dot(random, random))
        direction = jax.tree.map(lambda d, size=size: d / size, random)
        expected = dot(gradient, direction)
        difference = (along(direction, 1e-2) - along(direction, -1e-2)) / 2e-2
        assert difference == pytest.approx(expected, abs=1e-2 * np.sqrt(dot(gradient, gradient) / 100))
