"""A learner that learns nothing but behaves like one, and a run of it that can be made to die at any moment.

As a script: `fake_run.py OUT UPDATES [KILL]` trains into OUT, resuming, and kills itself with SIGKILL just before its
KILL-th operation on a file in OUT.
"""

import os
import signal
import sys
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.policy import PolicyNetwork
from maipp.training import train as loop
from maipp.training.config import TrainConfig
from maipp.training.held_out import HeldOut

FILE_EVENTS = ("open", "os.rename", "os.remove", "os.rmdir", "os.mkdir", "shutil.rmtree", "os.truncate")


class FakeState(eqx.Module):
    """Stands for a `TrainState`: the same kinds of leaves."""

    network: PolicyNetwork
    optimiser: Any
    shards: Any
    updates: jax.Array


class FakeLearner:
    """Adds noise to the weights; the loss is NaN in update `breaks`, a weight is in update `spoils`."""

    def __init__(self, breaks: int = 0, spoils: int = 0) -> None:
        self.breaks, self.spoils = breaks, spoils

    def initial(self) -> FakeState:
        """The start, always the same."""
        network = PolicyNetwork(jax.random.key(0), width=8, heads=2, encoding_dimensions=4)
        moments = jax.tree.map(jnp.zeros_like, network)
        shards = {
            "key": jax.random.split(jax.random.key(1), 2),
            "active": jnp.ones((2, 3), bool),
            "x": jnp.ones((2, 5)),
        }
        return FakeState(network, (moments, jnp.zeros((), jnp.int32)), shards, jnp.zeros((), jnp.int32))

    def update(self, state: FakeState) -> tuple[FakeState, dict[str, jax.Array]]:
        """The next state, from the last one's keys."""
        return _update(state, self.breaks, self.spoils)


@eqx.filter_jit
def _update(state: FakeState, breaks: int, spoils: int) -> tuple[FakeState, dict[str, jax.Array]]:
    updates = state.updates + 1
    keys = jax.vmap(lambda key: jax.random.split(key)[0])(state.shards["key"])
    noise = jax.random.normal(keys[0], ()) * 1e-2
    factor = jnp.where(updates == spoils, jnp.nan, 1 + noise)
    network = jax.tree.map(lambda a: a * factor, state.network)
    moments = jax.tree.map(lambda m, w: 0.9 * m + 0.1 * w, state.optimiser[0], network)
    shards = {"key": keys, "active": ~state.shards["active"], "x": state.shards["x"] * (1 + noise)}
    loss = jnp.where(updates == breaks, jnp.nan, noise)
    metrics = {"loss": loss, "final_trace": 100.0 / updates, "missions_ended": updates % 2}
    return FakeState(network, (moments, state.optimiser[1] + 1), shards, updates), metrics


class FakeWorlds:
    """Held-out worlds whose trace is a number that follows from the weights."""

    name = "fake"

    def __init__(self, config: TrainConfig) -> None:
        pass

    def evaluate(self, network: PolicyNetwork) -> HeldOut:
        """A score."""
        return HeldOut(float(jnp.abs(network.value.hidden.weight).sum()), 0.5, 0.0)


def fake_config(updates: int) -> TrainConfig:
    """One that evaluates every other update and saves after each."""
    tiny = TrainConfig(events=2, missions=2, minibatch=4, imitation=0, search=0, updates=updates)
    return tiny.replace(evaluate_every=2, checkpoint_seconds=1e-9)


def die_before(operation: int, folder: str) -> None:
    """Make this process kill itself before the given operation on a file in the folder."""
    count = 0

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal count
        if event in FILE_EVENTS and str(arguments[0]).startswith(folder):
            count += 1
            if count == operation:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


if __name__ == "__main__":
    loop.HeldOutWorlds = FakeWorlds  # type: ignore[misc, assignment]
    if len(sys.argv) > 3:
        die_before(int(sys.argv[3]), sys.argv[1])
    loop.train(fake_config(int(sys.argv[2])), Path(sys.argv[1]), resume=True, learner=FakeLearner())
