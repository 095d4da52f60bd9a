"""Worlds to train in: a bank of roadmaps drawn beforehand, and fields, budgets and symmetries drawn on the fly."""

from functools import lru_cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from maipp.engine import Mission, draw_missions
from maipp.engine.mission import mission_parts
from maipp.fields.mixture import evaluation_grid, sample_mixture
from maipp.problem import Params, Shape, shape_of
from maipp.roadmap import Roadmap
from maipp.scenario import Scenario
from maipp.training.config import TRAINING_SEEDS, TrainConfig
from maipp.training.random_zones import random_zones
from maipp.training.ranges import draw_params, extreme_scenarios
from maipp.typing import Array, Bool, Float, Index, Int, Key


class Bank(NamedTuple):
    """Roadmaps of b teams that start together."""

    roadmap: Roadmap  # leading axes (b, m), with encodings
    start: Float[Array, "b m 2"]
    inside: Bool[Array, "b q"] | None = None  # grid points outside of each world's no-go zones; None: there are none


class TrainingWorld(NamedTuple):
    """One world: which of the bank's roadmaps, seen how, and what lies there."""

    field: Array  # the ground truth, a pytree callable on points
    truth: Float[Array, " q"]
    params: Params  # its numbers
    roadmap: Index  # row of the bank
    symmetry: Int[Array, ""]  # of the square, 0..7
    signs: Float[Array, " e"]  # +-1 for each column of the encoding


def training_scenario(config: TrainConfig) -> Scenario:
    """The scenario with the largest of the numbers that missions draw."""
    return extreme_scenarios(config)[1]


@lru_cache(maxsize=8)
def training_shape(config: TrainConfig) -> Shape:
    """The shape that all missions fit: room for the longest budget at the shortest interval."""
    low, high = extreme_scenarios(config)
    return shape_of([low, high, low.replace(budget=config.budget[1])])


def draw_bank(config: TrainConfig, scenario: Scenario, encodings: int) -> Bank:
    """The bank of this configuration; one bank is the same on every machine."""
    seed = TRAINING_SEEDS + config.seed
    if config.zones is None:
        missions = draw_missions(scenario, seed=seed, instances=config.bank, encodings=encodings)
        assert missions.roadmap is not None
        return Bank(missions.roadmap, missions.start)
    rows = []
    for row in range(config.bank):
        among = scenario.replace(obstacles=random_zones(np.random.default_rng([seed, row]), config.zones))
        parts = mission_parts(among, seed=seed, first=row, instances=1, encodings=encodings)
        rows.append(Bank(parts["roadmap"], parts["start"], parts["inside"]))
    return jax.tree.map(lambda *arrays: jnp.asarray(np.concatenate(arrays)), *rows)


def draw_world(config: TrainConfig, scenario: Scenario, bank: Bank, key: Key) -> TrainingWorld:
    """A world: random roadmap of the bank in a random symmetry, random field, numbers in the ranges of the config."""
    field_key, budget_key, row_key, symmetry_key, sign_key = jax.random.split(key, 5)
    grid = evaluation_grid(scenario.grid, scenario.extent)
    field = sample_mixture(
        field_key,
        components=scenario.mixture_components,
        variance=scenario.mixture_variance,
        extent=scenario.extent,
        grid=grid,
    )
    budget = jax.random.uniform(budget_key, (), minval=config.budget[0], maxval=config.budget[1])
    assert bank.roadmap.encoding is not None
    return TrainingWorld(
        field=field,  # type: ignore[arg-type]  # a pytree of arrays
        truth=field(grid),
        params=draw_params(config, scenario, budget, key),
        roadmap=jax.random.randint(row_key, (), 0, bank.start.shape[0]),
        symmetry=jax.random.randint(symmetry_key, (), 0, 8),
        signs=jax.random.rademacher(sign_key, (bank.roadmap.encoding.shape[-1],), jnp.float32),
    )


def turned(symmetry: Int[Array, ""], points: Float[Array, "*p 2"]) -> Float[Array, "*p 2"]:
    """Points of the unit square under one of its 8 symmetries: bit 0 swaps x and y, bits 1 and 2 mirror them."""
    points = jnp.where(symmetry & 1, points[..., ::-1], points)
    mirror = jnp.stack([symmetry >> 1 & 1, symmetry >> 2 & 1]) == 1
    return jnp.where(mirror, 1.0 - points, points)


def seen_inside(bank: Bank, world: TrainingWorld, side: int) -> Bool[Array, " q"]:
    """Grid points outside of the no-go zones, as the world's symmetry shows them; the grid has `side` points a side."""
    if bank.inside is None:
        return jnp.ones(side * side, bool)
    # A point of the seen grid is where the symmetry took one of the bank's: axes swapped first, then mirrored.
    square = bank.inside[world.roadmap].reshape(side, side)
    square = jnp.where(world.symmetry & 1, square.T, square)
    square = jnp.where(world.symmetry >> 1 & 1, square[::-1], square)
    return jnp.where(world.symmetry >> 2 & 1, square[:, ::-1], square).reshape(-1)


def mission_of(config: TrainConfig, bank: Bank, world: TrainingWorld) -> Mission:
    """The mission to be simulated, without roadmaps: `agent_roadmap` gives the due agent's when it is asked for."""
    shape = training_shape(config)
    grid = evaluation_grid(shape.grid, world.params.extent)
    return Mission(
        shape=shape,
        params=world.params,
        field=world.field,
        grid=grid,
        truth=world.truth,
        inside=seen_inside(bank, world, shape.grid),
        start=turned(world.symmetry, bank.start[world.roadmap]),
        roadmap=None,
    )


def agent_roadmap(bank: Bank, world: TrainingWorld, agent: Index) -> Roadmap:
    """The roadmap of one agent, turned and with its encoding's signs as the world has them."""
    own = jax.tree.map(lambda a: a[world.roadmap, agent], bank.roadmap)
    return Roadmap(
        nodes=turned(world.symmetry, own.nodes),
        neighbours=own.neighbours,
        distances=own.distances,
        reachable=own.reachable,
        encoding=own.encoding * world.signs,
    )
