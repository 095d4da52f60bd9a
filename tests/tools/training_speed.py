"""`python -m tests.tools.training_speed`: decisions per second while training, sampling and gradients apart.

And what share of the machine's arithmetic the gradients use: their operations, counted by hand, against those of a
matrix product in the same time.
"""

import sys
import time
import timeit
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import jax
import jax.numpy as jnp
import tyro

from maipp.bench.command import machines
from maipp.bench.provenance import machine, versions
from maipp.devices import missions_devices, use_all_cores
from maipp.errors import InputError
from maipp.markdown import markdown_table
from maipp.policy import PolicyNetwork
from maipp.training.config import TrainConfig
from maipp.training.config_io import find_config, override
from maipp.training.learner import Learner
from maipp.training.worlds import training_scenario

_GEMM = 1024  # rows and columns of the matrix product that stands for the machine's peak

# What makes every update of a run one of this phase.
PHASES = {"imitate": {"imitation": 1}, "reinforce": {}, "search": {"search": 1}}


@dataclass(frozen=True)
class TrainingSpeed:
    """Time an update of every phase of training on all devices, with one pass over its decisions and with two."""

    config: str = "default"
    """named configuration or YAML file"""

    settings: Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="KEY=VALUE [KEY=VALUE ...]")] = ()
    """values to change in it"""

    repeat: int = 3
    """updates timed; the fastest counts"""


class Speed(NamedTuple):
    """Of one phase, on all devices together."""

    phase: str
    sampling: float  # decisions sampled per second
    gradients: float  # decisions passed through a gradient per second
    peak_share: float  # operations of the gradients over those of matrix products in the same time


def training_speed(config: TrainConfig, phase: str, repeat: int = 3) -> Speed:
    """The speed of a phase: a second pass takes as long as the first, the rest of an update is sampling.

    Raises InputError for a phase that is none.
    """
    if phase not in PHASES:
        raise InputError(f"phase {phase!r}: there is none of that name; give one of {', '.join(PHASES)}")
    devices = missions_devices()
    devices = devices if config.shards % len(devices) == 0 else devices[:1]
    whole = {"imitation": 0, "search": 0, "updates": 1} | PHASES[phase]
    once, twice = (
        update_seconds(Learner(config.replace(**whole, epochs=epochs), devices), repeat) for epochs in (1, 2)
    )
    count, one_pass = config.transitions_per_update, max(twice - once, 1e-9)
    sampling = max(once - one_pass, 1e-9)
    network = PolicyNetwork(jax.random.key(0))
    operations = 3 * count * forward_operations(network, training_scenario(config).nodes)
    return Speed(phase, count / sampling, count / one_pass, operations / one_pass / (gemm_rate() * len(devices)))


def update_seconds(learner: Learner, repeat: int) -> float:
    """Seconds of the fastest of several updates, each from the first state; an update gives away what it is given."""
    state = jax.block_until_ready(learner.update(learner.initial())[0])
    times = []
    for _ in range(repeat):
        state = jax.block_until_ready(learner.initial())
        begun = time.perf_counter()
        jax.block_until_ready(learner.update(state))
        times.append(time.perf_counter() - begun)
    return min(times)


def forward_operations(network: PolicyNetwork, nodes: int) -> float:
    """Multiplications and additions of one encoding and one decoder step: matrix products only."""
    width = network.width
    features = network.embed.weight.size + network.embed_encoding.weight.size
    # Four projections and a hidden layer four times as wide; then everybody attends to everybody.
    layer = nodes * 12 * width**2 + 2 * nodes**2 * width
    decoder = 20 * width**2 + 2 * nodes * width  # state, LSTM, one attending query, its perceptron, pointer
    return 2.0 * (nodes * (features + 2 * width**2) + network.encoder_layers * layer + decoder)


def gemm_rate() -> float:
    """Operations per second of a float32 matrix product on one device."""
    a = jnp.ones((_GEMM, _GEMM), jnp.float32)
    product: Callable[[jax.Array], Any] = jax.jit(lambda a: a @ a)
    jax.block_until_ready(product(a))
    seconds = timeit.repeat(lambda: jax.block_until_ready(product(a)), number=1, repeat=8)
    return 2.0 * _GEMM**3 / min(seconds)


def main(flags: TrainingSpeed) -> int:
    """Print a table; gives the exit code."""
    try:
        config = override(find_config(flags.config), flags.settings)
        heading = ["phase", "sampling, decisions/s", "gradients, decisions/s", "share of a matrix product's speed"]
        print(markdown_table(heading, []))
        for phase in PHASES:
            speed = training_speed(config, phase, flags.repeat)
            print(f"| {phase} | {speed.sampling:.0f} | {speed.gradients:.0f} | {speed.peak_share:.0%} |", flush=True)
        print(f"\n{machines((machine(), versions()))}; a device's matrix product: {gemm_rate() / 1e9:.0f} GFLOP/s")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    use_all_cores()
    sys.exit(main(tyro.cli(TrainingSpeed, prog="python -m tests.tools.training_speed")))
