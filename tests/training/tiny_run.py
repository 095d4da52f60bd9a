"""A tiny run of the real learner: `tiny_run.py OUT [--half OUT] [--port PORT --process ID]`, which resumes.

Then the first half of it into a second folder, if there is one, with what is compiled already. With a port it is one of
two processes that train together. A process of its own, since JAX joins others only once.
"""

import argparse
import os
import signal
from pathlib import Path

from maipp.devices import use_all_cores
from maipp.training.config import TrainConfig
from maipp.training.hosts import hosts_of, join_hosts
from maipp.training.learner import Learner
from maipp.training.train import Step, train

TINY = TrainConfig(
    agents=2,
    budget=(0.6, 0.8),
    bank=2,
    shards=2,
    missions=2,
    events=4,
    epochs=1,
    minibatch=4,
    paths=1,
    steps=1,
    imitation=0,
    search=0,
    updates=4,
    learning_rate=1e-3,
    evaluate_every=4,
    evaluate_instances=2,
    evaluate_budget=0.6,
)

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    parser.add_argument("--half", type=Path)
    parser.add_argument("--port")
    parser.add_argument("--process", type=int)
    given = parser.parse_args()
    use_all_cores(1)
    flags = {"coordinator": f"127.0.0.1:{given.port}", "process_id": given.process, "processes": 2}
    processes = join_hosts(**(flags if given.port else {}), environment={})
    hosts = hosts_of(TINY.shards)
    assert (len(hosts.devices), hosts.process, hosts.processes) == (processes, given.process or 0, processes), hosts

    def stop(step: Step) -> None:
        """Interrupt half-way."""
        if step.update == TINY.updates // 2:
            os.kill(os.getpid(), signal.SIGTERM)

    learner = Learner(TINY, hosts.devices)
    train(TINY, given.out, resume=True, hosts=hosts, learner=learner)
    if given.half:
        train(TINY, given.half, resume=True, hosts=hosts, learner=learner, progress=stop)
