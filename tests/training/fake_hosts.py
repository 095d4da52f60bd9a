"""One of two processes that train together by the command line, the learner and the held-out worlds fake.

`fake_hosts.py FAULT PORT PROCESS ARGUMENT...`; of the faults, `learner` breaks process 1 and `evaluation` process 0.
"""

import sys
from typing import Any

from fake_run import FakeLearner, FakeWorlds  # beside this script

from maipp.cli import main as command
from maipp.devices import use_all_cores
from maipp.errors import InputError
from maipp.policy import PolicyNetwork
from maipp.training import train as loop
from maipp.training.held_out import HeldOut

FAULT, PORT, PROCESS = sys.argv[1:4]


class Worlds(FakeWorlds):
    """Held-out worlds that may fail."""

    def evaluate(self, network: PolicyNetwork) -> HeldOut:
        """A score."""
        if FAULT == "evaluation":
            raise MemoryError("no room for the worlds")
        return super().evaluate(network)


def learner(*given: Any) -> FakeLearner:
    """The learner, where this process has one."""
    if FAULT == "learner" and PROCESS == "1":
        raise InputError("own.safetensors: no such file")
    return FakeLearner()


if __name__ == "__main__":
    use_all_cores(1)
    loop.HeldOutWorlds = Worlds  # type: ignore[misc, assignment]
    loop.Learner = learner  # type: ignore[misc, assignment]
    command.prepare_jax = lambda: None
    joined = ["--coordinator", f"127.0.0.1:{PORT}", "--process-id", PROCESS, "--processes", "2"]
    sys.exit(command.main(["train", *sys.argv[4:], *joined]))
