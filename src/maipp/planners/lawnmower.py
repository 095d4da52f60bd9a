"""`lawnmower`: one strip per agent, swept in parallel rows; looks at no measurement."""

import equinox as eqx
import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, PyTree, option
from maipp.errors import InputError
from maipp.planners.plane_planner import PlanePlanner
from maipp.planners.sweep import Sweep, clipped_sweep
from maipp.roadmap.ways import TURNS, waypoints, ways_from
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Array, Float, Index, Int, Key

_MOST_ROWS = 32


class Lawnmower(PlanePlanner):
    """Boustrophedon sweep of the agent's own strip `[i/m, (i+1)/m]` of the domain's width.

    By default rows and margin are tuned to the budget, the same for every agent. Where there are no-go zones the rows
    are clipped to what is free, agents go from piece to piece by the shortest way, and then on to the others' strips.
    """

    rows: int = option(0, meaning="rows per strip; 0 chooses by the budget")
    margin: float = option(-1.0, meaning="row ends to strip sides, per strip width; < 0 by the budget")

    memory_of_place = True  # the number of a vertex, whose rows zones cut and teams share

    sweep: Sweep | None = eqx.field(default=None, kw_only=True)  # where there are no-go zones: what is left of the rows

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.zones is not None and self.sweep is None and isinstance(self.scenario, Scenario):
            self.check()
            rows, margin = self.tuned()
            self.sweep = clipped_sweep(self.scenario, int(rows), float(margin), self.zones.borders.corners.shape[0])

    @property
    def waypoints_per_decision(self) -> int:
        """One vertex; with no-go zones the turns on the way to it."""
        return 1 if self.zones is None else TURNS

    def check(self) -> None:
        """Raise InputError for options out of range."""
        if not 0 <= self.rows <= _MOST_ROWS:
            raise InputError(f"rows={self.rows}: give 1 to {_MOST_ROWS}, or 0 to choose by the budget")
        if not self.margin < 0.5:
            raise InputError(f"margin={self.margin}: give a share of the strip's width in [0, 0.5), or -1")

    def tuned(self) -> tuple[Int[Array, ""], Float[Array, ""]]:
        """Rows and margin in use.

        The rule was fitted to Tr(P) over rows x margins at three agents and B = 2..5 (100 instances, seed 7): wide
        margins where the budget is short, and as many rows as fit the strip besides a way to it of 0.15 sides.
        """
        width, height = self.scenario.extent
        budget = jnp.sum(jnp.asarray(self.scenario.budgets)) / self.scenario.agents
        margin = jnp.clip(0.35 - 0.1 * budget / height, 0.05, 0.25) if self.margin < 0 else jnp.asarray(self.margin)
        across = width / self.scenario.agents * (1 - 2 * margin)
        way = 0.15 * (width + height) / 2
        count = jnp.arange(1, _MOST_ROWS + 1)
        fits = way + count * across + (count - 1) / count * height <= budget + DISTANCE_TOLERANCE
        return jnp.asarray(self.rows or jnp.max(jnp.where(fits, count, 1))), margin

    def initial_memory(self) -> PyTree:
        """Number of the next vertex of the sweep."""
        return jnp.zeros((), jnp.int32)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next vertex of the sweep; stops after the last."""
        if self.zones is not None:
            return self._next_piece(observation, memory)
        vertices, swept = self._sweep(observation)
        # A vertex that coincides with the start would end the mission there.
        offset = vertices - observation.position
        distance = jnp.sqrt(jnp.sum(offset * offset, axis=-1))
        index = jnp.arange(vertices.shape[0])
        ahead = (index >= memory) & (index < swept) & (distance > DISTANCE_TOLERANCE)
        following = jnp.argmax(ahead).astype(jnp.int32)
        return Decision(vertices[following][None], (), following + 1, ~ahead.any())

    def _next_piece(self, observation: Observation, memory: Index) -> Decision:
        """The way to the next end of a piece of a row; stops after the last."""
        zones, sweep, here = self.zones, self.sweep, observation.position
        assert zones is not None and sweep is not None
        _, _, from_right, from_top = self._strip(observation)
        variant = 2 * from_top.astype(jnp.int32) + from_right.astype(jnp.int32)
        order = sweep.order[observation.agent, variant]
        ways = ways_from(zones, here, sweep.points[order], sweep.onward[:, order])
        ahead = jnp.arange(len(order)) >= memory
        ahead &= (
            sweep.valid[observation.agent, variant] & jnp.isfinite(ways.length) & (ways.length > DISTANCE_TOLERANCE)
        )
        following = jnp.argmax(ahead).astype(jnp.int32)
        way = waypoints(zones, ways, following)
        arrived = (way[-1] == ways.ends[following]).all()
        return Decision(way, (), jnp.where(arrived, following + 1, following), ~ahead.any())

    def _strip(self, observation: Observation) -> tuple[Array, Array, Array, Array]:
        """Both sides of the agent's rows, and whether its sweep begins from the right and from the top."""
        _, margin = self.tuned()
        width, height = self.scenario.extent
        strip = width / self.scenario.agents
        left = strip * (observation.agent + margin)
        right = strip * (observation.agent + 1 - margin)
        start = observation.start
        # Begin at the nearest of the four corners of the sweep.
        from_right = jnp.abs(start[0] - right) < jnp.abs(start[0] - left)
        from_top = start[1] > height / 2
        return left, right, from_right, from_top

    def _sweep(self, observation: Observation) -> tuple[Float[Array, "v 2"], Int[Array, ""]]:
        """Vertices of the agent's sweep, and how many they are: room is for those of the most rows."""
        rows, _ = self.tuned()
        height = self.scenario.extent[1]
        left, right, from_right, from_top = self._strip(observation)
        gap = height / rows
        vertex = jnp.arange(4 * _MOST_ROWS - 2)
        row, second = vertex // 2, vertex % 2
        # What is left of the budget after the last row is spent on the way back, between the rows.
        y = jnp.where(row < rows, row + 0.5, 2 * rows - 1 - row) * gap
        y = jnp.where(from_top, height - y, y)
        at_right = ((row + second) % 2 == 1) ^ from_right
        return jnp.stack([jnp.where(at_right, right, left), y], axis=-1), 4 * rows - 2
