"""Numbers of a scenario that each mission of a training run draws for itself."""

import dataclasses
import math

import jax
import jax.numpy as jnp

from maipp.problem import Params, params_of
from maipp.scenario import Scenario
from maipp.training.config import RANGES, TrainConfig, ends
from maipp.typing import Array, Float, Key


def extreme_scenarios(config: TrainConfig) -> tuple[Scenario, Scenario]:
    """The scenario with the low end of every range, and with the high end; every mission's numbers lie between.

    Raises `FieldError` for an end that no scenario may have.
    """
    low, high = ({name: ends(getattr(config, name))[side] for name in (*RANGES, "budget")} for side in (0, 1))
    near, far = ends(config.comm_range)
    sizes = {"agents": config.agents}
    return Scenario.create(**sizes, **low, comm_range=near), Scenario.create(**sizes, **high, comm_range=far)


def draw_params(config: TrainConfig, scenario: Scenario, budget: Float[Array, ""], key: Key) -> Params:
    """The numbers of one mission: uniform in their ranges, the communication range uniform in its inverse.

    So "none", a range without end, is the end of the scale at 0. `budget` (domain units) is every robot's.
    """
    params = params_of(scenario)
    drawn: dict[str, Array] = {"budgets": jnp.full(scenario.agents, budget)}
    for number, name in enumerate((*RANGES, "comm_range")):
        low, high = ends(getattr(config, name))
        if low == high:
            continue
        own = jax.random.fold_in(key, number)
        if name == "comm_range":
            inverse = [0.0 if end is None else 1.0 / end for end in (high, low)]
            drawn[name] = 1.0 / jax.random.uniform(own, (), minval=inverse[0], maxval=inverse[1])
        elif name == "speed":
            drawn["speeds"] = jax.random.uniform(own, (scenario.agents,), minval=low, maxval=high)
        else:
            drawn[name] = jax.random.uniform(own, (), minval=low, maxval=high)
    if config.team is not None:
        own = jax.random.fold_in(key, len(RANGES) + 1)
        size = jax.random.randint(own, (), config.team[0], config.team[1] + 1)
        drawn["present"] = jnp.arange(scenario.agents) < size
    return dataclasses.replace(params, **drawn)


def middle(value: float | tuple[float, float]) -> float:
    """Of a range: what held-out worlds have."""
    low, high = ends(value)
    assert low is not None and high is not None and math.isfinite(high)
    return 0.5 * (low + high)
