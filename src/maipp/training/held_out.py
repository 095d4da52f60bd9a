"""How good a network is along the way: its planner on worlds that no training run draws."""

import dataclasses
import math
import time
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.engine import draw_missions, run_missions
from maipp.engine.score import score_missions
from maipp.planners import make_planner
from maipp.policy import PolicyNetwork
from maipp.scenario import Scenario
from maipp.training.config import TrainConfig
from maipp.training.ranges import middle

# Apart from the seeds 0, 1, 2... that people give to `maipp evaluate` and to training.
EVALUATION_SEED = 1_720_934_515

PLANNERS = {"ti": "intent-paths", "sga-catnipp": "sga-catnipp"}  # who moves by the network that is trained


class HeldOut(NamedTuple):
    """Final Tr(P) on the held-out worlds."""

    trace: float  # mean
    se: float | None  # its standard error over worlds; None for one world
    seconds: float


class HeldOutWorlds:
    """The held-out worlds of a configuration, drawn once."""

    def __init__(self, config: TrainConfig) -> None:
        """Draw them."""
        self.scenario = Scenario.create(
            agents=config.agents, length_scale=middle(config.length_scale), budget=config.evaluate_budget
        )
        self.name = PLANNERS[config.policy]
        self._planner = make_planner(self.name, self.scenario, {"weights": "untrained"})
        self._missions = draw_missions(
            self.scenario,
            seed=EVALUATION_SEED,
            instances=config.evaluate_instances,
            planner=self._planner,
        )

    def evaluate(self, network: PolicyNetwork) -> HeldOut:
        """Run and score the planner with this network, which must lie on the default device alone."""
        began = time.perf_counter()
        before: Any = self._planner
        planner = dataclasses.replace(before, sampler=dataclasses.replace(before.sampler, network=network))
        states = run_missions(planner, self._missions, jax.random.key(EVALUATION_SEED))
        traces = np.asarray(score_missions(self._missions, states).trace, np.float64)
        se = float(traces.std(ddof=1)) / math.sqrt(len(traces)) if len(traces) > 1 else None
        return HeldOut(float(traces.mean()), se, time.perf_counter() - began)
