"""`lawnmower`: one strip per agent, swept in parallel rows; looks at no measurement."""

import equinox as eqx
import jax.numpy as jnp

from maipp.errors import InputError
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.simulator.decision import Decision, Observation, Planner, PyTree
from maipp.typing import Array, Float, Key

_MOST_ROWS = 32


class Lawnmower(Planner):
    """Boustrophedon sweep of the agent's own strip `[i/m, (i+1)/m]` of the domain's width.

    By default rows and margin are tuned to the budget, the same for every agent.
    """

    rows: int = eqx.field(static=True, default=0)  # rows per strip; 0 chooses by the budget
    margin: float = eqx.field(static=True, default=-1.0)  # row ends to strip sides, per strip width; < 0 by the budget

    def check(self) -> None:
        """Raise InputError for options out of range."""
        if not 0 <= self.rows <= _MOST_ROWS:
            raise InputError(f"rows={self.rows}: give 1 to {_MOST_ROWS}, or 0 to choose by the budget")
        if not self.margin < 0.5:
            raise InputError(f"margin={self.margin}: give a share of the strip's width in [0, 0.5), or -1")

    def tuned(self) -> tuple[int, float]:
        """Rows and margin in use.

        The rule was fitted to Tr(P) over rows x margins at three agents and B = 2..5 (100 instances, seed 7): wide
        margins where the budget is short, and as many rows as fit the strip besides a way to it of 0.15 sides.
        """
        width, height = self.scenario.extent
        budget = sum(self.scenario.budgets) / self.scenario.agents
        margin = self.margin if self.margin >= 0 else min(max(0.35 - 0.1 * budget / height, 0.05), 0.25)
        across = width / self.scenario.agents * (1 - 2 * margin)
        way = 0.15 * (width + height) / 2
        fits = [r for r in range(1, _MOST_ROWS + 1) if way + r * across + (r - 1) / r * height <= budget]
        return self.rows or max(fits, default=1), margin

    def initial_memory(self) -> PyTree:
        """Number of the next vertex of the sweep."""
        return jnp.zeros((), jnp.int32)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next vertex of the sweep; stops after the last."""
        vertices = self._sweep(observation)
        # A vertex that coincides with the start would end the mission there.
        offset = vertices - observation.position
        distance = jnp.sqrt(jnp.sum(offset * offset, axis=-1))
        index = jnp.arange(vertices.shape[0])
        ahead = (index >= memory) & (distance > DISTANCE_TOLERANCE)
        following = jnp.argmax(ahead).astype(jnp.int32)
        return Decision(vertices[following][None], (), following + 1, ~ahead.any())

    def _sweep(self, observation: Observation) -> Float[Array, "v 2"]:
        """Vertices of the agent's sweep."""
        rows, margin = self.tuned()
        width, height = self.scenario.extent
        strip = width / self.scenario.agents
        left = strip * (observation.agent + margin)
        right = strip * (observation.agent + 1 - margin)
        start = observation.start
        gap = height / rows
        # Begin at the nearest of the four corners of the sweep.
        from_right = jnp.abs(start[0] - right) < jnp.abs(start[0] - left)
        from_top = start[1] > height / 2
        vertex = jnp.arange(4 * rows - 2)
        row, second = vertex // 2, vertex % 2
        # What is left of the budget after the last row is spent on the way back, between the rows.
        y = jnp.where(row < rows, row + 0.5, 2 * rows - 1 - row) * gap
        y = jnp.where(from_top, height - y, y)
        at_right = ((row + second) % 2 == 1) ^ from_right
        return jnp.stack([jnp.where(at_right, right, left), y], axis=-1)
