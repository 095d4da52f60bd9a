"""Rows of a sweep without no-go zones: how many fit the budget, and the vertices of an agent's way along them."""

import jax.numpy as jnp

from maipp.engine.decision import Observation
from maipp.problem import ScenarioLike
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Float, Int

MOST_ROWS = 32


def tuned(scenario: ScenarioLike, rows: int, margin: float) -> tuple[Int[Array, ""], Float[Array, ""]]:
    """Rows and margin in use, where 0 rows and a margin below 0 leave the choice to the budget.

    The rule was fitted to Tr(P) over rows x margins at three agents and B = 2..5 (100 instances, seed 7): wide
    margins where the budget is short, and as many rows as fit the strip besides a way to it of 0.15 sides.
    """
    width, height = scenario.extent
    budget = jnp.sum(jnp.asarray(scenario.budgets)) / scenario.agents
    chosen = jnp.clip(0.35 - 0.1 * budget / height, 0.05, 0.25) if margin < 0 else jnp.asarray(margin)
    across = width / scenario.agents * (1 - 2 * chosen)
    way = 0.15 * (width + height) / 2
    count = jnp.arange(1, MOST_ROWS + 1)
    fits = way + count * across + (count - 1) / count * height <= budget + DISTANCE_TOLERANCE
    return jnp.asarray(rows or jnp.max(jnp.where(fits, count, 1))), chosen


def strip(
    scenario: ScenarioLike, observation: Observation, margin: Float[Array, ""]
) -> tuple[Array, Array, Array, Array]:
    """Both sides of the due agent's rows, and whether its sweep begins from the right and from the top."""
    width, height = scenario.extent
    across = width / scenario.agents
    left = across * (observation.agent + margin)
    right = across * (observation.agent + 1 - margin)
    start = observation.start
    # Begin at the nearest of the four corners of the sweep.
    return left, right, jnp.abs(start[0] - right) < jnp.abs(start[0] - left), start[1] > height / 2


def vertices(
    scenario: ScenarioLike, observation: Observation, rows: Int[Array, ""], margin: Float[Array, ""]
) -> tuple[Float[Array, "v 2"], Int[Array, ""]]:
    """Vertices of the due agent's sweep, and how many they are: room is for those of the most rows."""
    height = scenario.extent[1]
    left, right, from_right, from_top = strip(scenario, observation, margin)
    gap = height / rows
    vertex = jnp.arange(4 * MOST_ROWS - 2)
    row, second = vertex // 2, vertex % 2
    # What is left of the budget after the last row is spent on the way back, between the rows.
    y = jnp.where(row < rows, row + 0.5, 2 * rows - 1 - row) * gap
    y = jnp.where(from_top, height - y, y)
    at_right = ((row + second) % 2 == 1) ^ from_right
    return jnp.stack([jnp.where(at_right, right, left), y], axis=-1), 4 * rows - 2
