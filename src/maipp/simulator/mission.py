"""The world of one survey, drawn from a scenario: field, starts, roadmaps."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.fields import evaluation_grid, sample_mixture
from maipp.roadmap import Obstacles, Roadmap, sample_roadmaps
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Key, Keys

Field = Callable[[Float[Array, "n 2"]], Float[Array, " n"]]


class Mission(eqx.Module):
    """One drawn world. A batch of missions is the same pytree with a leading axis on every array."""

    field: Any  # a `Field` that is a pytree: the ground truth, callable on points
    grid: Float[Array, "*b q 2"]  # evaluation grid, domain units
    truth: Float[Array, "*b q"]  # the field on the grid, normalised units
    inside: Bool[Array, "*b q"]  # grid points of the survey area: False within no-go zones
    start: Float[Array, "*b m 2"]  # where each agent begins, domain units
    budgets: Float[Array, "*b m"]  # longest path of each agent, domain units
    speeds: Float[Array, "*b m"]  # domain units per unit of time
    roadmap: Roadmap | None  # arrays (*b, m, n, ...), or None where the planner needs no roadmap


def instance_keys(seed: int, instances: int) -> Keys:
    """One key per instance; instance i of a seed is the same world whatever the number of instances."""
    return jax.vmap(lambda i: jax.random.fold_in(jax.random.key(seed), i))(jnp.arange(instances))


def _free_start(key: Key, scenario: Scenario, obstacles: Obstacles | None) -> Float[Array, "2"]:
    """A uniform start outside the no-go zones."""
    draws = np.asarray(jax.random.uniform(key, (256, 2))) * np.asarray(scenario.extent)
    free = np.ones(len(draws), bool) if obstacles is None else obstacles.free(draws)
    if not free.any():
        raise ValueError("scenario.obstacles: they leave no room to start from (256 uniform draws all fell inside)")
    return jnp.asarray(draws[int(np.argmax(free))])


def _device_array(array: np.ndarray) -> Array:
    """The array on the device, floating point at JAX's precision."""
    return jnp.asarray(array, jnp.result_type(float) if np.issubdtype(array.dtype, np.floating) else None)


def draw_missions(
    scenario: Scenario,
    *,
    seed: int,
    instances: int,
    trials: int = 1,
    roadmaps: bool = True,
    field: Field | None = None,
) -> Mission:
    """A batch of `instances * trials` missions, instance slowest.

    The instance fixes field and start; the trial only draws fresh roadmaps (and the planner's own randomness), so all
    planners meet the same worlds. `field` replaces the random mixture by a given ground truth.
    """
    keys = instance_keys(seed, instances)
    obstacles = Obstacles(scenario.obstacles) if scenario.obstacles else None
    grid = evaluation_grid(scenario.grid, scenario.extent)
    inside = jnp.ones(grid.shape[0], bool) if obstacles is None else jnp.asarray(obstacles.free(np.asarray(grid)))
    if scenario.start is None:
        starts = jnp.stack([_free_start(jax.random.fold_in(key, 1), scenario, obstacles) for key in keys])
        starts = jnp.repeat(starts[:, None], scenario.agents, axis=1)
    else:
        given = jnp.asarray(scenario.start, jnp.result_type(float)).reshape(-1, 2)
        starts = jnp.broadcast_to(given, (instances, scenario.agents, 2))

    def world(key: Key) -> tuple[Any, Array]:
        drawn = (
            sample_mixture(
                jax.random.fold_in(key, 0),
                components=scenario.mixture_components,
                variance=scenario.mixture_variance,
                extent=scenario.extent,
                grid=grid,
            )
            if field is None
            else field
        )
        return drawn, drawn(grid)

    fields, truth = jax.jit(jax.vmap(world))(keys)
    roadmap = None
    if roadmaps:
        drawn = [
            sample_roadmaps(
                np.random.default_rng([seed, i, trial]),
                np.asarray(starts[i]),
                nodes=scenario.nodes,
                neighbours=scenario.neighbours,
                extent=scenario.extent,
                obstacles=scenario.obstacles,
            )
            for i in range(instances)
            for trial in range(trials)
        ]
        roadmap = jax.tree.map(lambda *rows: _device_array(np.stack(rows)), *drawn)
    batch = instances * trials

    def per_mission(array: Array) -> Array:
        return jnp.broadcast_to(array, (batch, *array.shape))

    return Mission(
        field=jax.tree.map(lambda a: jnp.repeat(a, trials, axis=0), fields),
        grid=per_mission(grid),
        truth=jnp.repeat(truth, trials, axis=0),
        inside=per_mission(inside),
        start=jnp.repeat(starts, trials, axis=0),
        budgets=per_mission(jnp.asarray(scenario.budgets)),
        speeds=per_mission(jnp.asarray(scenario.speeds)),
        roadmap=roadmap,
    )
