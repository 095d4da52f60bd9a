"""A training run of a foresight: updates, log, checkpoints, evaluations and weights, until done or interrupted."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.foresight.shipped import FINAL, FORESIGHT
from maipp.policy import save_weights
from maipp.training.checkpoint import load_latest, save_checkpoint
from maipp.training.config_io import config_to_dict
from maipp.training.foresight.bank import make_bank
from maipp.training.foresight.calibration import (
    CALIBRATED,
    CALIBRATION_SEED,
    VALIDATION_SEED,
    calibrated,
    evaluation,
    samples_of,
)
from maipp.training.foresight.config import ForesightConfig
from maipp.training.foresight.learner import FitState, ForesightLearner
from maipp.training.run_folder import CHECKPOINTS, RunProgress, claim
from maipp.training.signals import StopRequest
from maipp.training.train import DivergedError
from maipp.training.training_log import TrainingLog


class FitStep(NamedTuple):
    """What the run reports after each update (`metrics`) and each evaluation (`evaluation`)."""

    update: int
    updates: int  # in all
    wall_s: float
    metrics: Mapping[str, float]
    evaluation: Mapping[str, float] | None = None


class FitResult(NamedTuple):
    """How a run ended."""

    record: RunProgress
    interrupted: bool


def train_foresight(
    config: ForesightConfig,
    out: Path,
    *,
    resume: bool = False,
    progress: Callable[[FitStep], None] = lambda step: None,
    tell: Callable[[str], None] = lambda text: None,
    about: Mapping[str, Any] | None = None,
    learner: ForesightLearner | None = None,
) -> FitResult:
    """Train into the folder `out`, or go on with the run it holds; Ctrl-C and SIGTERM save a checkpoint and return.

    `tell` is told what is done before the first update; `about` (the machine, say) goes into the card of the weights;
    `learner` is one of the same configuration whose programs are compiled already.
    Resumed on the same device, a run ends with the same bytes as one that was never stopped. Raises InputError for a
    folder that is taken or holds another configuration, and DivergedError where the loss is no longer finite.
    """
    claim(out, config, resume=resume)
    began = time.monotonic()
    with StopRequest() as stop:
        routes = make_bank(config, out, tell, lambda: stop.requested)
        if routes is None:
            return FitResult(RunProgress(wall_s=time.monotonic() - began), True)
        learner = learner or ForesightLearner(config, routes)
        return _Life(config, out, learner, dict(about or {}), progress, began).run(stop)


class _Life:
    """One life of a run: from its newest checkpoint, or its start, to its end or the next interrupt."""

    def __init__(
        self,
        config: ForesightConfig,
        out: Path,
        learner: ForesightLearner,
        about: dict[str, Any],
        progress: Callable[[FitStep], None],
        began: float,
    ) -> None:
        self.config, self.out, self.learner, self.about, self.progress = config, out, learner, about, progress
        self.state: FitState = learner.initial()
        self.record = RunProgress()
        self.began = began
        found = load_latest(out / CHECKPOINTS, jax.device_get(self.state))
        if found is not None:
            self.state, self.record = jax.tree.map(jax.numpy.asarray, found[0]), RunProgress.from_card(found[1])
        self.earlier_s, self.saved_at = self.record.wall_s, time.monotonic()
        drawn = samples_of(config, learner.routes, learner.kinds, VALIDATION_SEED, config.validation)
        self.validation = jax.device_get(list(drawn))

    def run(self, stop: StopRequest) -> FitResult:
        """Train until done or asked to stop."""
        journal = TrainingLog(self.out, updates=self.record.update, evaluated=self.record.evaluated)
        try:
            while True:
                done = self.record.update
                if self.record.evaluated < done and (done % self.config.evaluate_every == 0 or self._over):
                    self._evaluate(journal)
                if stop.requested or self._over:
                    break
                if time.monotonic() - self.saved_at >= self.config.checkpoint_seconds:
                    self._save()
                self._update(journal)
            self._save()
            if self._over:
                self._finish()
        finally:
            journal.close()
        return FitResult(self.record, not self._over)

    @property
    def _over(self) -> bool:
        return self.record.update == self.config.updates

    def _update(self, journal: TrainingLog) -> None:
        """One update, checked and logged."""
        self.state, metrics = self.learner.update(self.state)
        values = {name: float(value) for name, value in jax.device_get(metrics).items()}
        update = self.record.update + 1
        if not np.isfinite(values["loss"]):
            raise DivergedError(
                f"training diverged in update {update}: the loss is {values['loss']}; the checkpoints in "
                f"{self.out / CHECKPOINTS} are good. Start anew in another folder, with a lower learning_rate"
            )
        samples = update * self.config.steps * self.config.batch
        self.record = self.record._replace(update=update, transitions=samples, wall_s=self._wall_s())
        journal.write({"update": update, "samples": samples, "wall_s": round(self.record.wall_s, 3), **values})
        self.progress(FitStep(update, self.config.updates, self.record.wall_s, values))

    def _evaluate(self, journal: TrainingLog) -> None:
        """Score the mean weights on the validation samples."""
        values = evaluation(self.state.average, self.validation, self.config)
        values = {name: round(value, 5) for name, value in values.items()}
        record = self.record._replace(evaluated=self.record.update, wall_s=self._wall_s())
        self.record = record._replace(last={"update": record.update, **values})
        journal.write({"update": record.update, "wall_s": round(record.wall_s, 3), "evaluation": values})
        self.progress(FitStep(record.update, self.config.updates, record.wall_s, {}, values))

    def _save(self) -> None:
        """A checkpoint, unless there is one of this very update."""
        self.record = self.record._replace(wall_s=self._wall_s())
        about = {**self.record._asdict(), "config": config_to_dict(self.config), **self.about}
        save_checkpoint(self.out / CHECKPOINTS, self.record.update, jax.device_get(self.state), about)
        self.saved_at = time.monotonic()

    def _finish(self) -> None:
        """The weights, calibrated, with their card."""
        learner = self.learner
        drawn = samples_of(
            self.config, learner.routes, learner.kinds, CALIBRATION_SEED, CALIBRATED * self.config.validation
        )
        model = calibrated(self.state.average, drawn)
        card = {
            "command": "maipp train foresight",
            "training": config_to_dict(self.config),
            "seed": self.config.seed,
            "updates": self.record.update,
            "samples": self.record.transitions,
            "wall_s": round(self._wall_s(), 1),
            "evaluation": {"seed": VALIDATION_SEED, "samples": self.config.validation, **(self.record.last or {})},
            "calibration": {
                "seed": CALIBRATION_SEED,
                "samples": CALIBRATED * self.config.validation,
                "widening": [round(float(each), 4) for each in model.widening],
            },
            "licence": "Apache-2.0",
            **self.about,
        }
        save_weights(model, self.out / FINAL, card, FORESIGHT)

    def _wall_s(self) -> float:
        return self.earlier_s + time.monotonic() - self.began
