"""Cells of a table whose worlds are drawn from the scenario's own prior, as in a survey whose kernel was fitted."""

import dataclasses
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp

from maipp.belief import Matern32
from maipp.bench.cells import Cell, CellResult
from maipp.bench.evaluate import scored
from maipp.bench.fingerprint import code_digest
from maipp.bench.machine import machine, versions
from maipp.engine import Mission, Planner, draw_missions
from maipp.fields.gp_field import draw_fields
from maipp.planners import make_planner
from maipp.problem import Shape
from maipp.scenario import Scenario

# Mixed into the seed for the fields, so that they share no key with an instance, nor with the planner.
_FIELD_STREAM = 0xFFFFFFFE


@dataclass(frozen=True)
class PriorCell(Cell):
    """The missions of one row at one budget, the ground truth a draw of the prior with the scenario's kernel."""

    @cached_property
    def _made_by(self) -> dict[str, Any]:
        return {**super()._made_by, "worlds": "prior", "draws": code_digest((__name__,))}

    def compute(self) -> CellResult:
        """Run the missions."""
        begun = time.perf_counter()
        planner = make_planner(self.row.planner, self.scenario, self.row.options)
        missions = prior_missions(self.scenario, planner, self.seed, self.instances, self.trials, self.shape)
        values = scored(planner, missions, self.seed, self.trials)
        return CellResult(values, time.perf_counter() - begun, machine(), versions())


def prior_missions(
    scenario: Scenario, planner: Planner, seed: int, instances: int, trials: int, shape: Shape | None = None
) -> Mission:
    """A batch of `instances * trials` missions as `draw_missions` draws them, but for the ground truth: a draw of the
    Gaussian process that the scenario describes. The instance fixes it, whatever the planner and the budget."""
    missions = draw_missions(scenario, seed=seed, instances=instances, trials=trials, planner=planner, shape=shape)
    kernel = Matern32(scenario.length_scale, scenario.signal_variance)
    drawn = draw_fields(jax.random.fold_in(jax.random.key(seed), _FIELD_STREAM), kernel, instances)
    fields = jax.tree.map(lambda leaf: jnp.repeat(leaf, trials, axis=0), drawn)
    truth = jax.jit(jax.vmap(lambda field, grid: field(grid)))(fields, missions.grid)
    return dataclasses.replace(missions, field=fields, truth=truth)
