"""Speed of training: what is counted, and that every phase is timed."""

import jax
import pytest

from maipp.errors import InputError
from maipp.policy import PolicyNetwork
from maipp.training.config import TrainConfig
from tests.tools.training_speed import PHASES, TrainingSpeed, forward_operations, main, training_speed

TINY = TrainConfig(
    agents=2, budget=(0.6, 0.8), bank=1, shards=1, missions=2, events=2, minibatch=4, paths=1, steps=1, search_paths=2,
    elites=1, imitation=0, search=0,
)  # fmt: skip


def test_operations_are_those_of_the_matrix_products():
    """About 0.1 GFLOP for an encoding of 200 nodes; the attention grows with the square of the nodes."""
    network = PolicyNetwork(jax.random.key(0))
    assert 1.0e8 < forward_operations(network, 200) < 1.3e8
    small, large = (forward_operations(network, n) for n in (200, 400))
    square = 2 * 2 * network.width * (400**2 - 2 * 200**2)
    constant = forward_operations(network, 0)
    assert large - 2 * small == pytest.approx(square - constant)


@pytest.mark.slow
def test_a_phase_is_timed_in_parts():
    speed = training_speed(TINY, "reinforce", repeat=1)
    assert speed.phase == "reinforce" and speed.sampling > 0 and speed.gradients > 0 and speed.peak_share > 0
    assert set(PHASES) == {"imitate", "reinforce", "search"}


def test_what_is_none_is_refused(capsys):
    with pytest.raises(InputError, match="phase 'dream'"):
        training_speed(TINY, "dream")
    assert main(TrainingSpeed(config="nothing")) == 2
    assert capsys.readouterr().err.startswith("error: --config nothing")
