"""Worlds drawn from the scenario's own prior, as in a survey whose kernel was fitted."""

import dataclasses

import jax
import jax.numpy as jnp

from maipp.belief import Matern32
from maipp.engine import Mission, Planner, draw_missions
from maipp.fields.gp_field import draw_fields
from maipp.problem import Shape
from maipp.scenario import Scenario

# Mixed into the seed for the fields, so that they share no key with an instance, nor with the planner.
_FIELD_STREAM = 0xFFFFFFFE


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
