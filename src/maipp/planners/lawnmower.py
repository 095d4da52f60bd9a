"""`lawnmower`: one strip per agent, swept in parallel rows; looks at no measurement."""

import equinox as eqx
import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import option
from maipp.errors import InputError
from maipp.planners.plane.planner_zones import planner_zones
from maipp.planners.plane.rows import MOST_ROWS, strip, tuned, vertices
from maipp.planners.plane.sweep import Sweep, clipped_sweep
from maipp.roadmap.shortest_paths import TURNS, shortest_paths, waypoints
from maipp.roadmap.zones import Zones
from maipp.scenario import DISTANCE_TOLERANCE, Scenario
from maipp.typing import Array, Float, Index, Int, Key


class Lawnmower(Planner):
    """Boustrophedon sweep of the agent's own strip `[i/m, (i+1)/m]` of the domain's width.

    By default rows and margin are tuned to the budget, the same for every agent. Where there are no-go zones the rows
    are clipped to what is free, agents go from piece to piece by the shortest way, and then on to the others' strips.
    """

    rows: int = option(0, meaning="rows per strip; 0 chooses by the budget")
    margin: float = option(-1.0, meaning="row ends to strip sides, per strip width; < 0 by the budget")

    avoids_obstacles = True
    memory_of_place = True  # the number of a vertex, whose rows zones cut and teams share

    zones: Zones | None = eqx.field(default=None, kw_only=True)  # None: those of the scenario, if it has any
    sweep: Sweep | None = eqx.field(default=None, kw_only=True)  # where there are no-go zones: what is left of the rows

    def __post_init__(self) -> None:
        self.zones = planner_zones(self.scenario) if self.zones is None else self.zones
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
        if not 0 <= self.rows <= MOST_ROWS:
            raise InputError(f"rows={self.rows}: give 1 to {MOST_ROWS}, or 0 to choose by the budget")
        if not self.margin < 0.5:
            raise InputError(f"margin={self.margin}: give a share of the strip's width in [0, 0.5), or -1")

    def tuned(self) -> tuple[Int[Array, ""], Float[Array, ""]]:
        """Rows and margin in use."""
        return tuned(self.scenario, self.rows, self.margin)

    def initial_memory(self) -> PyTree:
        """Number of the next vertex of the sweep."""
        return jnp.zeros((), jnp.int32)

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next vertex of the sweep; stops after the last."""
        if self.zones is not None:
            return self._next_piece(observation, memory)
        corners, swept = vertices(self.scenario, observation, *self.tuned())
        # A vertex that coincides with the start would end the mission there.
        offset = corners - observation.position
        distance = jnp.sqrt(jnp.sum(offset * offset, axis=-1))
        index = jnp.arange(corners.shape[0])
        ahead = (index >= memory) & (index < swept) & (distance > DISTANCE_TOLERANCE)
        following = jnp.argmax(ahead).astype(jnp.int32)
        return Decision(corners[following][None], (), following + 1, ~ahead.any())

    def _next_piece(self, observation: Observation, memory: Index) -> Decision:
        """The way to the next end of a piece of a row; stops after the last."""
        zones, sweep, here = self.zones, self.sweep, observation.position
        assert zones is not None and sweep is not None
        _, _, from_right, from_top = strip(self.scenario, observation, self.tuned()[1])
        variant = 2 * from_top.astype(jnp.int32) + from_right.astype(jnp.int32)
        order = sweep.order[observation.agent, variant]
        ways = shortest_paths(zones, here, sweep.points[order], sweep.onward[:, order])
        ahead = jnp.arange(len(order)) >= memory
        ahead &= (
            sweep.valid[observation.agent, variant] & jnp.isfinite(ways.length) & (ways.length > DISTANCE_TOLERANCE)
        )
        following = jnp.argmax(ahead).astype(jnp.int32)
        way = waypoints(zones, ways, following)
        arrived = (way[-1] == ways.ends[following]).all()
        return Decision(way, (), jnp.where(arrived, following + 1, following), ~ahead.any())
