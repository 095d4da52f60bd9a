"""A training run: updates, log, checkpoints, held-out evaluations and weights, until done or interrupted."""

import hashlib
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.errors import InputError
from maipp.policy import save_weights
from maipp.policy.shipped import BEST
from maipp.training import checkpoint
from maipp.training.config import TrainConfig
from maipp.training.config_io import config_to_dict, dump_config
from maipp.training.curves import draw_learning_curve
from maipp.training.held_out import EVALUATION_SEED, HeldOut, HeldOutWorlds
from maipp.training.hosts import Hosts, all_or_none, any_of, from_first, from_host, hosts_of, to_host
from maipp.training.learner import Learner
from maipp.training.run_folder import CHECKPOINTS, RunProgress, claim
from maipp.training.signals import StopRequest
from maipp.training.training_log import TrainingLog

T = TypeVar("T")

FINAL = "final.safetensors"


@runtime_checkable
class LearnerLike(Protocol):
    """What the loop needs of a `Learner`."""

    def initial(self) -> Any:
        """The state before the first update: a pytree of arrays with `network` and `updates`."""
        ...

    def update(self, state: Any) -> tuple[Any, dict[str, jax.Array]]:
        """The state after one update, and its metrics: scalars, `loss` among them."""
        ...


class DivergedError(InputError):
    """The loss or a weight is no longer a finite number."""


class Step(NamedTuple):
    """What the run reports after each update (`metrics`) and each evaluation (`held_out`)."""

    update: int
    updates: int  # in all
    transitions: int
    wall_s: float
    metrics: Mapping[str, float]
    held_out: HeldOut | None = None


class TrainResult(NamedTuple):
    """How a run ended."""

    record: RunProgress
    interrupted: bool
    checkpoint: Path  # the newest


def train(
    config: TrainConfig,
    out: Path,
    *,
    resume: bool = False,
    progress: Callable[[Step], None] | None = None,
    hosts: Hosts | None = None,
    about: Mapping[str, Any] | None = None,
    learner: LearnerLike | None = None,
) -> TrainResult:
    """Train into the folder `out`, or go on with the run it holds; Ctrl-C and SIGTERM save a checkpoint and return.

    `about` (the machine, say) goes into the cards of the weights. Resumed on the same device, a run ends with the same
    bytes as one that was never stopped.

    Raises InputError for a folder that is taken or holds another configuration, and DivergedError, which names the last
    good checkpoint, where the loss or a weight is no longer finite: on all processes, whichever of them cannot go on.
    """
    hosts = hosts or all_or_none(lambda: hosts_of(config.shards), jax.process_count())
    _check_agreed(config, hosts)
    all_or_none(lambda: claim(out, config, resume=resume, writes=hosts.process == 0), hosts.processes)
    learner = learner or all_or_none(lambda: Learner(config, hosts.devices), hosts.processes)
    return _Run(config, out, hosts, learner, dict(about or {}), progress or (lambda step: None)).run()


def _check_agreed(config: TrainConfig, hosts: Hosts) -> None:
    """Raise InputError where this process was given another configuration than process 0."""
    mine = np.frombuffer(hashlib.sha256(dump_config(config).encode()).digest(), np.uint8)
    if any_of(bool((from_first(mine, hosts.processes) != mine).any()), hosts.processes):
        raise InputError("training: the processes were given different configurations; give all of them the same flags")


class _Run:
    """One life of a run: from its newest checkpoint, or its start, to its end or the next interrupt."""

    def __init__(
        self,
        config: TrainConfig,
        out: Path,
        hosts: Hosts,
        learner: LearnerLike,
        about: dict[str, Any],
        progress: Callable[[Step], None],
    ) -> None:
        self.config, self.out, self.hosts, self.learner = config, out, hosts, learner
        self.about, self.progress = about, progress
        self.writes = hosts.process == 0
        self.began = time.monotonic()
        self.state, self.record = self._load()
        self.earlier_s = self.record.wall_s
        self.saved_at, self.saved = time.monotonic(), self.record.update
        self.worlds: HeldOutWorlds | None = None
        self.journal: TrainingLog | None = None

    def run(self) -> TrainResult:
        """Train until done or asked to stop."""
        self.journal = self._on_first(
            lambda: TrainingLog(self.out, updates=self.record.update, evaluated=self.record.evaluated)
        )
        try:
            with StopRequest() as stop:
                self._save()
                interrupted = self._loop(stop)
                self._save()
        finally:
            if self.journal is not None:
                self.journal.close()
        self._on_first(lambda: self._finish(interrupted))
        return TrainResult(self.record, interrupted, self._checkpoint)

    def _loop(self, stop: StopRequest) -> bool:
        """Update by update; True if stopped before the end."""
        config = self.config
        while True:
            if any_of(stop.requested, self.hosts.processes):
                return True
            done = self.record.update
            if self.record.evaluated < done and (done % config.evaluate_every == 0 or done == config.updates):
                self._evaluate()
                continue  # whoever asked to stop meanwhile is not kept waiting for another update
            if done == config.updates:
                return False
            due = self.writes and time.monotonic() - self.saved_at >= config.checkpoint_seconds
            if any_of(due, self.hosts.processes):
                self._save()
            self._update()

    def _update(self) -> None:
        """One update, checked and logged."""
        began = time.perf_counter()
        self.state, metrics = self.learner.update(self.state)
        values = {name: float(value) for name, value in jax.device_get(metrics).items()}
        seconds = time.perf_counter() - began
        update = self.record.update + 1
        self._check(update, values["loss"])
        self.record = self.record._replace(
            update=update, transitions=update * self.config.transitions_per_update, wall_s=self._wall_s()
        )
        row = {
            "update": update,
            "transitions": self.record.transitions,
            "wall_s": round(self.record.wall_s, 3),
            "update_s": round(seconds, 4),
            "transitions_per_s": round(self.config.transitions_per_update / seconds, 2),
        }
        self._tell({**row, **values}, values)

    def _check(self, update: int, loss: float) -> None:
        """Raise DivergedError where the loss or a weight is not finite."""
        wrong = f"the loss is {loss}" if not np.isfinite(loss) else "a weight is not a finite number"
        if not np.isfinite(loss) or not _all_finite(self.state.network):
            raise DivergedError(
                f"training diverged in update {update}: {wrong}; the last good checkpoint is {self._checkpoint}. "
                "Start anew in another folder, with a lower learning_rate or gradient_norm"
            )

    def _evaluate(self) -> None:
        """Score the network on the held-out worlds; keep it if it is the best so far."""
        self.record = self.record._replace(evaluated=self.record.update)
        self._on_first(self._score)

    def _score(self) -> None:
        """The evaluation itself, on the process that writes."""
        done = self.record.update
        self.worlds = self.worlds or HeldOutWorlds(self.config)
        network = jax.tree.map(jnp.asarray, to_host(self.state.network))
        held_out = self.worlds.evaluate(network)
        self.record = self.record._replace(wall_s=self._wall_s())
        evaluation = {
            "planner": self.worlds.name,
            "budget": self.config.evaluate_budget,
            "instances": self.config.evaluate_instances,
            "seed": EVALUATION_SEED,
            "trace": held_out.trace,
            "se": held_out.se,
            "seconds": round(held_out.seconds, 3),
        }
        if self.record.best is None or held_out.trace < self.record.best["trace"]:
            self.record = self.record._replace(best={"update": done, **evaluation})
            save_weights(network, self.out / BEST, self._card(evaluation))
        self.record = self.record._replace(last={"update": done, **evaluation})
        row = {"update": done, "transitions": self.record.transitions, "wall_s": round(self.record.wall_s, 3)}
        self._tell({**row, "evaluation": evaluation}, {}, held_out)
        draw_learning_curve(self.out, self._title())

    def _tell(self, row: Mapping[str, Any], metrics: Mapping[str, float], held_out: HeldOut | None = None) -> None:
        """One line of the log, and the caller's progress."""
        if self.journal is not None:
            self.journal.write(row)
        record = self.record
        if self.writes:
            self.progress(
                Step(record.update, self.config.updates, record.transitions, record.wall_s, metrics, held_out)
            )

    def _save(self) -> None:
        """A checkpoint, unless there is one of this very update."""
        arrays = to_host(self.state)
        self.record = self.record._replace(wall_s=self._wall_s())
        about = {**self.record._asdict(), "config": config_to_dict(self.config), **self.about}
        self._on_first(lambda: checkpoint.save_checkpoint(self.out / CHECKPOINTS, self.record.update, arrays, about))
        self.saved, self.saved_at = self.record.update, time.monotonic()

    def _load(self) -> tuple[Any, RunProgress]:
        """The state and the record to go on from."""
        state = self.learner.initial()
        arrays = to_host(state)
        loaded = self._on_first(lambda: checkpoint.load_latest(self.out / CHECKPOINTS, arrays))
        if not any_of(loaded is not None, self.hosts.processes):
            return state, RunProgress()
        found, card = loaded if loaded is not None else (arrays, RunProgress()._asdict())
        update, evaluated = from_first(np.array([card["update"], card["evaluated"]]), self.hosts.processes)
        record = RunProgress.from_card(card)._replace(update=int(update), evaluated=int(evaluated))
        return from_host(from_first(found, self.hosts.processes), state), record

    def _on_first(self, action: Callable[[], T]) -> T | None:
        """What the action gives on the process that writes, None on the others; where it fails, all of them end."""
        return all_or_none(lambda: action() if self.writes else None, self.hosts.processes)

    def _finish(self, interrupted: bool) -> None:
        """The final weights and the figure."""
        if not interrupted:
            network = jax.tree.map(jnp.asarray, to_host(self.state.network))
            save_weights(network, self.out / FINAL, self._card(self.record.last))
        draw_learning_curve(self.out, self._title())

    def _card(self, evaluation: Mapping[str, Any] | None) -> dict[str, Any]:
        """What the weights are, beside them."""
        return {
            "policy": self.config.policy,
            "training": config_to_dict(self.config),
            "seed": self.config.seed,
            "updates": self.record.update,
            "transitions": self.record.transitions,
            "wall_s": round(self.record.wall_s, 1),
            "evaluation": evaluation,
            "licence": "Apache-2.0",
            **self.about,
        }

    @property
    def _checkpoint(self) -> Path:
        return self.out / CHECKPOINTS / f"{self.saved:06d}"

    def _wall_s(self) -> float:
        return self.earlier_s + time.monotonic() - self.began

    def _title(self) -> str:
        config = self.config
        budget = f"{config.evaluate_budget:g}"
        return f"{config.policy}, seed {config.seed}: {config.agents} agents, held out at budget {budget}"


@eqx.filter_jit
def _finite(network: Any) -> jax.Array:
    return jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(eqx.filter(network, eqx.is_array))]).all()


def _all_finite(network: Any) -> bool:
    return bool(_finite(network))
